#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <new>
#include <vector>

#include "hamelin/model/model.hpp"

namespace hamelin::dynamics {

struct KernelSet;

/// Memory for the kernels' scratch, aligned for any SIMD register.
class Memory {
 public:
  static constexpr std::align_val_t alignment{64};

  explicit Memory(std::size_t bytes) : bytes_(static_cast<std::byte*>(::operator new(bytes, alignment))) {}
  [[nodiscard]] void* get() noexcept { return bytes_.get(); }

 private:
  struct Free {
    void operator()(std::byte* p) const noexcept { ::operator delete(p, alignment); }
  };
  std::unique_ptr<std::byte, Free> bytes_;
};

/// All scratch of the algorithms for one model and one thread, and which instruction set they run on: core's
/// selected_isa() when it was made. Made once; nothing allocates afterwards.
class Workspace {
 public:
  explicit Workspace(const model::Model& model);

  /// A link's joint-aligned frame in the world, as the last forward_kinematics left it.
  struct Frame {
    Eigen::Matrix3d R;
    Eigen::Vector3d p;
    Eigen::Vector3d axis;  ///< the joint's axis (revolute) or direction (prismatic), unit, world
  };

  const KernelSet* kernels;
  Memory sweep;  ///< scratch of the kernels
  std::vector<Frame> frames;
  /// Angular velocity and velocity of a frame's origin, or moment about it and force; world axes.
  struct Pair {
    Eigen::Vector3d angular, linear;
  };
  std::vector<Pair> motions, forces;
  Eigen::VectorXd column_in, column_out;  ///< joint vectors of operational_inertia
};

/// Scratch for many states at once (inverse_dynamics_batch, forward_dynamics_batch); of one thread.
class BatchWorkspace {
 public:
  explicit BatchWorkspace(const model::Model& model);

  const KernelSet* kernels;
  Memory sweep;
};

}  // namespace hamelin::dynamics

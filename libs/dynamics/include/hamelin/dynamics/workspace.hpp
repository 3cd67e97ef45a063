#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <utility>
#include <vector>

#include "hamelin/core/isa.hpp"
#include "hamelin/model/model.hpp"

namespace hamelin::dynamics {

struct KernelSet;

/// Scratch memory for the kernels, aligned for any SIMD register.
class AlignedBuffer {
 public:
  static constexpr std::align_val_t alignment{64};

  explicit AlignedBuffer(std::size_t bytes)
      : bytes_(static_cast<std::byte*>(::operator new(bytes, alignment))) {}
  [[nodiscard]] void* get() noexcept { return bytes_.get(); }

 private:
  struct Free {
    void operator()(std::byte* p) const noexcept { ::operator delete(p, alignment); }
  };
  std::unique_ptr<std::byte, Free> bytes_;
};

/// Identifies the model that a workspace was made for. Calls compare it with the model in their
/// arguments.
struct WorkspaceOwner {
  /// No model has this id.
  static constexpr std::uint64_t no_model = ~std::uint64_t{0};

  /// @throws Error usage for a model that was moved from
  explicit WorkspaceOwner(const model::Model& model);
  WorkspaceOwner(WorkspaceOwner&& other) noexcept { *this = std::move(other); }
  WorkspaceOwner& operator=(WorkspaceOwner&& other) noexcept {
    id = std::exchange(other.id, no_model);
    posed_id = std::exchange(other.posed_id, no_model);
    dof = other.dof;
    return *this;
  }
  WorkspaceOwner(const WorkspaceOwner&) = delete;
  WorkspaceOwner& operator=(const WorkspaceOwner&) = delete;
  ~WorkspaceOwner() = default;

  std::uint64_t id;                   ///< Model::id; no_model after the workspace was moved from
  std::uint64_t posed_id = no_model;  ///< the same id once the workspace has poses
  Eigen::Index dof;
};

/// Scratch memory of the algorithms for one model (or its copies) and one thread, and the
/// instruction set that they use. After its construction no call allocates. It does not keep the
/// model; calls take both and refuse a workspace that was made for another model or moved from.
class Workspace {
 public:
  /// @throws Error usage if this machine does not have the instruction set, or for a model that was
  ///         moved from
  explicit Workspace(const model::Model& model, Isa isa = default_isa());
  /// Deleted: a temporary model is gone before any call could use the workspace.
  explicit Workspace(const model::Model&& model, Isa isa = default_isa()) = delete;

  /// A link's joint-aligned frame in the world, written by forward_kinematics.
  struct Frame {
    Eigen::Matrix3d R;
    Eigen::Vector3d p;
    Eigen::Vector3d axis;  ///< the joint's axis (revolute) or direction (prismatic), unit, world
  };

  WorkspaceOwner owner;
  const KernelSet* kernels;
  AlignedBuffer sweep;  ///< scratch of the kernels
  std::vector<Frame> frames;
  /// Angular velocity and the velocity of a frame's origin, or a moment about the origin and a
  /// force; world axes.
  struct Pair {
    Eigen::Vector3d angular, linear;
  };
  std::vector<Pair> motions, forces;
  Eigen::VectorXd column_in, column_out;  ///< joint vectors of operational_inertia
};

/// Scratch memory of one thread for many states at once (inverse_dynamics and forward_dynamics of
/// matrices).
class BatchWorkspace {
 public:
  /// @throws Error usage as Workspace
  explicit BatchWorkspace(const model::Model& model, Isa isa = default_isa());
  /// Deleted: a temporary model is gone before any call could use the workspace.
  explicit BatchWorkspace(const model::Model&& model, Isa isa = default_isa()) = delete;

  WorkspaceOwner owner;
  const KernelSet* kernels;
  AlignedBuffer sweep;
};

}  // namespace hamelin::dynamics

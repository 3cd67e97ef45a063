#pragma once
#include <Eigen/Core>
#include <array>
#include <memory>
#include <vector>

#include "hamelin/dynamics/inverse_kinematics.hpp"
#include "kernel/root_lanes.hpp"

namespace hamelin::search {

/// Inverse kinematics of sixteen postures at once, in single precision: brings them near to their
/// targets, and dynamics::InverseKinematics takes them the rest of the way.
class RootLanes {
 public:
  using Targets = std::array<dynamics::TipTarget, kernel::lanes>;

  /// Both must outlive this.
  RootLanes(const model::Model& model, const dynamics::JointBox& box);

  /// Whether the lanes have room for the arm and its joint limits.
  [[nodiscard]] bool fits() const noexcept { return fits_; }
  /// @param targets in the world, all with `turns` of the first; near is what is near for all
  /// @param q dof × lanes, in the box
  void begin(const Targets& targets, const Eigen::MatrixXd& q);
  /// Moves all postures by so many steps. @return bits of those that came near to their targets
  [[nodiscard]] unsigned advance(int steps);
  /// Writes the postures to what begin() was given. Those of joints behind the tip stay
  void write(Eigen::MatrixXd& q) const;

 private:
  void set_targets(const Targets& targets);
  /// The factor and the offset from a joint's position to the angle or position of its frame.
  [[nodiscard]] double factor(Eigen::Index joint) const;
  [[nodiscard]] double offset(Eigen::Index joint) const;

  const model::Model& model_;
  const dynamics::JointBox& box_;
  const kernel::RootKernels& kernels_;
  std::vector<kernel::Joint> joints_;
  kernel::Chain chain_{};
  std::unique_ptr<kernel::RootTargets> targets_;
  std::unique_ptr<kernel::RootPostures> postures_;
  bool fits_;
};

}  // namespace hamelin::search

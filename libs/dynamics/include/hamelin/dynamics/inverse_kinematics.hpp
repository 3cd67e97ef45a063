#pragma once
#include <Eigen/Core>

#include "hamelin/dynamics/damped_inverse.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/joint_box.hpp"

namespace hamelin::dynamics {

/// Where the tip is to be, in the world.
struct TipTarget {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< [m]
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  bool turns = true;                               ///< whether the rotation counts
  double tolerance_m = 0.01, tolerance_rad = 0.1;  ///< above 0
};

/// Finds joint vectors at which the tip is at a target. One thread; no allocation after
/// construction.
class InverseKinematics {
 public:
  /// Both must outlive this.
  /// @throws Error usage for a box of another size
  InverseKinematics(const model::Model& model, const JointBox& box);
  /// Deleted: temporaries are gone before any call could use them.
  InverseKinematics(const model::Model&& model, const JointBox& box) = delete;
  InverseKinematics(const model::Model& model, const JointBox&& box) = delete;
  InverseKinematics(const model::Model&& model, const JointBox&& box) = delete;
  /// Damped least squares from q, docs/theory.md (15.16).
  /// @param q dof finite numbers, not a vector of the box
  /// @return whether q is now within a third of the target's tolerances
  /// @throws Error usage for numbers that are not finite, a matrix that is not a rotation by more
  ///         than 1e-6, or a tolerance that is not above 0; q is then unchanged
  [[nodiscard]] bool solve(const TipTarget& target, Eigen::VectorXd& q);
  /// The number of iterations of the last call.
  [[nodiscard]] int iterations() const noexcept { return iterations_; }

 private:
  const model::Model& model_;
  const JointBox& box_;
  Workspace ws_;
  Matrix6Xd J_;
  DampedInverse inverse_;
  Eigen::VectorXd step_;
  int iterations_ = 0;
};

}  // namespace hamelin::dynamics

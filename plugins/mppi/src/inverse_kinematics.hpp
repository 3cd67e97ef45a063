#pragma once
#include <Eigen/Core>

#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"
#include "task.hpp"

namespace hamelin::mppi {

/// The box in joint space from which random joint vectors are drawn: the joint limits less a
/// reserve, ±π where there are none.
struct JointBox {
  /// @param reserve kept from joint limits [rad or m]
  JointBox(const planning::Setup& setup, double reserve);
  void draw(Rng& rng, Eigen::VectorXd& q) const;
  Eigen::VectorXd lower, upper;
};

/// Finds joint vectors at which the tip is at a goal.
class InverseKinematics {
 public:
  InverseKinematics(const model::Model& model, const JointBox& box);
  /// Damped least squares from q, docs/theory.md (15.16).
  /// @return whether q is now within a third of the goal's tolerances
  [[nodiscard]] bool solve(const Goal& goal, Eigen::VectorXd& q);
  /// The number of iterations of the last call.
  [[nodiscard]] int iterations() const noexcept { return iterations_; }

 private:
  const model::Model& model_;
  const JointBox& box_;
  dynamics::Workspace ws_;
  dynamics::Matrix6Xd J_;
  Eigen::VectorXd step_;
  int iterations_ = 0;
};

}  // namespace hamelin::mppi

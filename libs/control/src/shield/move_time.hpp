#pragma once
#include <Eigen/Core>
#include <optional>

#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::control {

/// Finds how fast an arm can make the move of a FailSafe, from rest to rest along a joint line,
/// within limits of torque, speed, acceleration, jerk and change of torque: docs/theory.md (14.25).
/// One object per thread. No allocation after construction.
class MoveTime {
 public:
  /// All of size zero, or zero: unbounded.
  struct Limits {
    Eigen::VectorXd effort_max;        ///< [Nm or N]
    Eigen::VectorXd velocity_max;      ///< [rad/s or m/s]
    Eigen::VectorXd acceleration_max;  ///< [rad/s² or m/s²]
    Eigen::VectorXd jerk_max;          ///< [rad/s³ or m/s³]
    double torque_rate = 0.0;          ///< [Nm/s or N/s]
    double least_s = 0.0;              ///< no move is shorter
  };
  MoveTime(const model::Model& model, Limits limits);

  /// The duration of the move from q by `way`; none if the arm cannot hold itself on the way.
  [[nodiscard]] std::optional<double> find(const Eigen::VectorXd& q, const Eigen::VectorXd& way);

 private:
  static constexpr Eigen::Index points = 16;
  /// The least duration by all limits but those of torques.
  [[nodiscard]] double by_motion(const Eigen::VectorXd& q, const Eigen::VectorXd& way);

  const model::Model& model_;
  Limits limits_;
  dynamics::BatchWorkspace batch_;
  dynamics::Workspace ws_;
  dynamics::StatesXd q_, v_, a_, torque_, gravity_;
  Eigen::VectorXd momentum_;
};

}  // namespace hamelin::control

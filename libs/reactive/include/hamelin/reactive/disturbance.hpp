#pragma once
#include <algorithm>

#include "hamelin/planning/plugin.hpp"

namespace hamelin::reactive {

/// What disturbs the arm as the controller estimates it, scaled down to what friction and wrong
/// masses may explain: a share of the torque limits. Zero where no torques are sent.
/// docs/theory.md (10.23)
struct Disturbance {
  static constexpr double share = 0.3;
  Eigen::VectorXd acceleration;  ///< [rad/s² or m/s²]
  Eigen::VectorXd torque;        ///< that explains it [Nm or N]

  explicit Disturbance(Eigen::Index dof)
      : acceleration(Eigen::VectorXd::Zero(dof)), torque(acceleration) {}

  /// @param M mass matrix at the tick's configuration
  void take(const planning::Tick& tick, const planning::Setup& setup, const Eigen::MatrixXd& M) {
    acceleration.setZero();
    torque.setZero();
    if (!tick.disturbance()) return;
    acceleration = *tick.disturbance();
    torque.noalias() = M * acceleration;
    const auto effort = setup.effort_max();
    if (!effort) return;
    const double excess = torque.cwiseAbs().cwiseQuotient(share * *effort).maxCoeff();
    if (excess <= 1.0) return;
    acceleration /= excess;
    torque /= excess;
  }
};

}  // namespace hamelin::reactive

#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "hamelin/reactive/approach_speed.hpp"

namespace hamelin::reactive {

/// Motors whose torque changes at a limited rate. An arm that accelerates keeps doing so until its
/// torque has changed, so the planner decides on the velocity that it coasts to, and counts on the
/// way that is lost until the brakes act: docs/theory.md (10.29), (10.30).
class TorqueRamp {
 public:
  /// @param rate largest rate of each joint's torque [Nm/s or N/s]
  /// @param period_s control period @param delay_s of the torque
  TorqueRamp(const Eigen::VectorXd& rate, double period_s, double delay_s)
      : rate_(rate), step_(period_s * rate), delay_s_(period_s + delay_s) {
    coasting_ = mean_ = impulse_ = Eigen::VectorXd::Zero(rate.size());
  }

  /// Computes the coasting velocity: that after the torque has returned from the one issued last to
  /// the one that keeps the velocity, as fast as it can.
  /// @param neutral the torque that keeps the velocity @param W inverse of the mass matrix
  void update(const Eigen::VectorXd& last_torque, const Eigen::VectorXd& neutral,
              const Eigen::MatrixXd& W, const Eigen::VectorXd& v) {
    time_s_ = 0.0;
    for (Eigen::Index k = 0; k < rate_.size(); ++k) {
      const double excess = last_torque[k] - neutral[k], ramp_s = std::abs(excess) / rate_[k];
      impulse_[k] = 0.5 * excess * ramp_s;
      time_s_ = std::max(time_s_, ramp_s);
    }
    coasting_ = v;
    coasting_.noalias() += W * impulse_;
    mean_ = 0.5 * (v + coasting_);
  }
  [[nodiscard]] const Eigen::VectorXd& coasting_velocity() const noexcept { return coasting_; }

  /// What an approach along the row a loses before it is braked by `brake`.
  [[nodiscard]] BrakingLoss loss(const Eigen::VectorXd& a, const Eigen::MatrixXd& W, double brake) {
    impulse_.noalias() = W * a;
    return loss(-a.dot(mean_), impulse_, brake);
  }
  /// The same for joint k at its upper (side +1) or lower limit (side −1).
  [[nodiscard]] BrakingLoss loss_of_joint(Eigen::Index k, double side, const Eigen::MatrixXd& W,
                                          double brake) const {
    return loss(side * mean_[k], W.col(k), brake);
  }

  /// Bounds a torque to what can follow `last` after a period.
  void limit(Eigen::VectorXd& torque, const Eigen::VectorXd& last) const {
    for (Eigen::Index k = 0; k < step_.size(); ++k)
      torque[k] = std::clamp(torque[k], last[k] - step_[k], last[k] + step_[k]);
  }

 private:
  // Of the fastest ramp; the rest is left to other rows.
  static constexpr double share = 0.5;

  // Acceleration rises along the row with the slope share · |W a|·rate.
  template <class Wa>
  [[nodiscard]] BrakingLoss loss(double approach, const Wa& row, double brake) const {
    const double slope = share * row.cwiseAbs().dot(rate_);
    return {delay_s_ + 0.5 * brake / slope, std::max(0.0, approach * time_s_)};
  }

  Eigen::VectorXd rate_, step_;
  double delay_s_, time_s_ = 0.0;
  Eigen::VectorXd coasting_, mean_, impulse_;
};

}  // namespace hamelin::reactive

#pragma once
#include <Eigen/Core>

#include "hamelin/dynamics/dynamics.hpp"
#include "spline.hpp"

namespace hamelin::mppi {

/// Computed torque that follows a planned motion, with a triple closed-loop pole at −ρ:
/// docs/theory.md (15.15).
class Tracker {
 public:
  /// @param rate ρ [1/s]
  Tracker(Eigen::Index dof, double rate, double period_s)
      : k_p_(3.0 * rate * rate),
        k_v_(3.0 * rate),
        k_i_(rate * rate * rate),
        period_s_(period_s),
        error_(Eigen::VectorXd::Zero(dof)),
        integral_(error_),
        command_(error_) {}

  void reset() { integral_.setZero(); }
  /// @param torque_max limits the torque if it is not null; the integral rests where it does
  template <class Vector, class Limits>
  void torque(const model::Model& model, dynamics::Workspace& ws, const Vector& q, const Vector& v,
              const JointState& planned, const Limits& torque_max, Eigen::VectorXd& out) {
    error_ = planned.q - q;
    integral_ += period_s_ * error_;
    command_ = planned.a + k_p_ * error_ + k_v_ * (planned.v - v) + k_i_ * integral_;
    dynamics::inverse_dynamics(model, ws, q, planned.v, command_, out);
    if (!torque_max) return;
    for (Eigen::Index k = 0; k < out.size(); ++k)
      if (const double limit = (*torque_max)[k]; std::abs(out[k]) > limit) {
        out[k] = std::copysign(limit, out[k]);
        integral_[k] -= period_s_ * error_[k];
      }
  }

 private:
  double k_p_, k_v_, k_i_, period_s_;
  Eigen::VectorXd error_, integral_, command_;
};

}  // namespace hamelin::mppi

#include "loop/state_estimator.hpp"

#include <algorithm>
#include <cmath>

namespace hamelin::control {

using Eigen::VectorXd;

namespace {

// By how much the bandwidth rises at most, and the rate of the error's smoothing, both in
// bandwidths.
constexpr double largest_rise = 5.0, smoothing_rate = 3.0;
// Of the disturbance, where velocities are measured [1/s].
constexpr double disturbance_bandwidth = 100.0;

}  // namespace

StateEstimator::StateEstimator(Eigen::Index dof, double period_s)
    : period_s_(period_s),
      velocity_gain_((1.0 - std::exp(-disturbance_bandwidth * period_s)) / period_s) {
  q_ = v_ = disturbance_ = smooth_error_ = VectorXd::Zero(dof);
}

StateEstimator::StateEstimator(Eigen::Index dof, double period_s, double bandwidth, double noise)
    : period_s_(period_s),
      bandwidth_(bandwidth),
      noise_(noise),
      smoothing_(1.0 - std::exp(-smoothing_rate * bandwidth * period_s)),
      usual_(gains(bandwidth)) {
  q_ = v_ = disturbance_ = smooth_error_ = VectorXd::Zero(dof);
}

StateEstimator::Gains StateEstimator::gains(double bandwidth) const {
  const double theta = std::exp(-bandwidth * period_s_), rest = 1.0 - theta;
  return {1.0 - theta * theta * theta, 1.5 * rest * rest * (1.0 + theta) / period_s_,
          rest * rest * rest / (period_s_ * period_s_)};
}

void StateEstimator::start(const VectorXd& q, const VectorXd& v) {
  move_to(q, v);
  disturbance_.setZero();
}

void StateEstimator::move_to(const VectorXd& q, const VectorXd& v) {
  q_ = q;
  v_ = v;
  smooth_error_.setZero();
}

void StateEstimator::update(const VectorXd& q, const VectorXd& v, const VectorXd& acceleration) {
  predict(acceleration);
  if (velocity_gain_ == 0.0) return correct_by_position(q);
  disturbance_ += velocity_gain_ * (v - v_);
  q_ = q;
  v_ = v;
}

void StateEstimator::predict(const VectorXd& acceleration) {
  const double T = period_s_;
  q_ += T * v_ + (0.5 * T * T) * (acceleration + disturbance_);
  v_ += T * (acceleration + disturbance_);
}

void StateEstimator::correct_by_position(const VectorXd& q) {
  for (Eigen::Index k = 0; k < q.size(); ++k) {
    const double error = q[k] - q_[k];
    smooth_error_[k] += smoothing_ * (error - smooth_error_[k]);
    const double excess = std::abs(smooth_error_[k]);
    const Gains g = noise_ > 0.0 && excess > noise_
                        ? gains(bandwidth_ * std::min(largest_rise, excess / noise_))
                        : usual_;
    q_[k] += g.position * error;
    v_[k] += g.velocity * error;
    disturbance_[k] += g.disturbance * error;
  }
}

}  // namespace hamelin::control

#include "loop/state_estimator.hpp"

#include <algorithm>
#include <cmath>

namespace hamelin::control {

namespace {

// By how much the bandwidth rises at most, and the rate of the error's smoothing, both in
// bandwidths.
constexpr double largest_rise = 5.0, smoothing_rate = 3.0;

}  // namespace

StateEstimator::StateEstimator(Eigen::Index dof, double period_s, double bandwidth, double noise)
    : period_s_(period_s),
      bandwidth_(bandwidth),
      noise_(noise),
      smoothing_(1.0 - std::exp(-smoothing_rate * bandwidth * period_s)),
      usual_(gains(bandwidth)) {
  q_ = v_ = disturbance_ = smooth_error_ = Eigen::VectorXd::Zero(dof);
}

StateEstimator::Gains StateEstimator::gains(double bandwidth) const {
  const double theta = std::exp(-bandwidth * period_s_), rest = 1.0 - theta;
  return {1.0 - theta * theta * theta, 1.5 * rest * rest * (1.0 + theta) / period_s_,
          rest * rest * rest / (period_s_ * period_s_)};
}

void StateEstimator::start(const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
  q_ = q;
  v_ = v;
  disturbance_.setZero();
  smooth_error_.setZero();
}

void StateEstimator::update(const Eigen::VectorXd& q, const Eigen::VectorXd& acceleration) {
  const double T = period_s_;
  for (Eigen::Index k = 0; k < q.size(); ++k) {
    const double rate = acceleration[k] + disturbance_[k];
    q_[k] += T * v_[k] + 0.5 * T * T * rate;
    v_[k] += T * rate;
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

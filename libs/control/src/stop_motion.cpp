#include "hamelin/control/stop_motion.hpp"

#include <algorithm>

namespace hamelin::control {

using Eigen::VectorXd;

StopMotion::StopMotion(Eigen::Index dof) {
  for (auto* x : {&q_, &v_, &a_, &w_, &q_line_, &q_end_}) x->setZero(dof);
}

void StopMotion::set_at_rest(const VectorXd& q) {
  q_ = q_line_ = q_end_ = q;
  v_.setZero();
  a_.setZero();
  w_.setZero();
  braking_ = {1.0, 0.0, 0.0};
  speed_ = steady_s_ = duration_ = 0.0;
}

void StopMotion::set(const VectorXd& q, const VectorXd& v, const VectorXd& a,
                     const Braking& braking) {
  braking_ = braking;
  const auto [alpha, ramp, fade] = braking;
  q_ = q;
  v_ = v;
  a_ = a;
  w_ = v + 0.5 * ramp * a;
  q_line_ = q + ramp * v + ramp * ramp / 3.0 * a - alpha * ramp * ramp / 6.0 * w_;
  speed_ = 1.0 - 0.5 * alpha * ramp;
  const double at_fade = 0.5 * alpha * fade;  // s where the fade begins
  steady_s_ = std::max(0.0, (speed_ - at_fade) / alpha);
  const double sigma = 0.5 * (speed_ + at_fade) * steady_s_ + alpha * fade * fade / 6.0;
  q_end_ = q_line_ + sigma * w_;
  duration_ = ramp + steady_s_ + fade;
}

void StopMotion::at(double time_s, VectorXd& q, VectorXd& v) const {
  const auto [alpha, ramp, fade] = braking_;
  if (time_s >= duration_) {
    q = q_end_;
    v.setZero();
    return;
  }
  if (time_s < ramp) {
    const double t = time_s, share = t / ramp;
    v = v_ + t * (1.0 - 0.5 * share) * a_ - 0.5 * alpha * share * t * w_;
    q = q_ + t * v_ + t * t * (0.5 - share / 6.0) * a_ - alpha * share * t * t / 6.0 * w_;
    return;
  }
  double t = time_s - ramp;
  const double steady = std::min(t, steady_s_);
  double s = speed_ - alpha * steady;
  double sigma = 0.5 * (speed_ + s) * steady;
  t -= steady;
  if (t > 0.0) {
    sigma += t * (s - alpha * t * (0.5 - t / (6.0 * fade)));
    s -= alpha * t * (1.0 - 0.5 * t / fade);
  }
  q = q_line_ + sigma * w_;
  v = s * w_;
}

}  // namespace hamelin::control

#include "shield/stop_motion.hpp"

#include <algorithm>
#include <cmath>

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

// The joint's velocity in the ramp is v + a₀ t − (a₀ + α w) t²/(2 t_r), docs/theory.md (14.1).
StopMotion::Range StopMotion::range(Eigen::Index j) const {
  Range out{std::min({q_[j], q_line_[j], q_end_[j]}), std::max({q_[j], q_line_[j], q_end_[j]})};
  const auto [alpha, ramp, fade] = braking_;
  if (ramp == 0.0) return out;
  const double a = a_[j], v = v_[j], bend = -0.5 * (a + alpha * w_[j]) / ramp;
  const double square = a * a - 4.0 * bend * v;
  if (square < 0.0) return out;
  // both roots of bend t² + a t + v, without cancellation; infinite ones lie outside of the ramp
  const double sum = -0.5 * (a + std::copysign(std::sqrt(square), a));
  for (const double t : {sum / bend, v / sum}) {
    if (!(t > 0.0 && t < ramp)) continue;
    const double q = q_[j] + t * (v + t * (0.5 * a + t * bend / 3.0));
    out = {std::min(out.least, q), std::max(out.largest, q)};
  }
  return out;
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

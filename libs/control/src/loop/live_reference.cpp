#include "hamelin/control/live_reference.hpp"

#include <algorithm>

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// Time in which the rate changes from 0 to 1 [s].
constexpr double rate_change_s = 0.1;

}  // namespace

double ReferenceState::rate_for(double error) noexcept {
  return std::clamp((left_beyond - error) / (left_beyond - tracked_within), 0.0, 1.0);
}

void ReferenceState::slow_down(double rate_change) {
  a = rate * rate * a + rate_change * v;
  v *= rate;
}

LiveReference::LiveReference(Index dof)
    : between_(VectorXd::Zero(dof)), offset_(VectorXd::Zero(dof)) {
  state_.q = state_.v = state_.a = VectorXd::Zero(dof);
}

void LiveReference::start(const scene::Goal& goal) noexcept {
  goal_ = &goal;
  state_.time_s = 0.0;
  state_.ended = false;
  started_ = false;
  point_ = 0;
}

bool LiveReference::on_the_way() const noexcept {
  return goal_ != nullptr && !state_.ended && state_.error < ReferenceState::left_beyond;
}

const ReferenceState& LiveReference::update(double period_s, const VectorXd& q, const VectorXd& v) {
  if (started_)
    move_on(period_s);
  else
    begin(q);
  state_.error = error_of(q);
  if (state_.error >= ReferenceState::left_beyond) rejoin(q, v);
  return state_;
}

void LiveReference::begin(const VectorXd& q) {
  started_ = true;
  state_.rate = 1.0;
  evaluate(0.0);
  state_.error = error_of(q);
  if (state_.error <= ReferenceState::tracked_within) return;
  state_.rate = ReferenceState::rate_for(state_.error);
  evaluate(0.0);
}

void LiveReference::rejoin(const VectorXd& q, const VectorXd& v) {
  const double time_s = time_near(q);
  if (time_s < 0.0) return;
  state_.time_s = time_s;
  state_.rate = 1.0;
  evaluate(0.0);
  const double square = state_.v.squaredNorm();
  state_.rate = square > 0.0 ? std::clamp(v.dot(state_.v) / square, 0.0, 1.0) : 0.0;
  evaluate(0.0);
  state_.error = error_of(q);
}

void LiveReference::move_on(double period_s) {
  const double step = period_s / rate_change_s, before = state_.rate;
  state_.rate += std::clamp(ReferenceState::rate_for(state_.error) - before, -step, step);
  state_.time_s += 0.5 * period_s * (before + state_.rate);
  evaluate((state_.rate - before) / period_s);
}

void LiveReference::evaluate(double rate_change) {
  const scene::JointTrajectory& trajectory = *goal_->trajectory;
  state_.ended = state_.time_s >= trajectory.duration_s();
  state_.time_s = std::min(state_.time_s, trajectory.duration_s());
  point_ = trajectory.at(state_.time_s, state_.q, state_.v, state_.a, point_);
  if (state_.ended) {
    state_.v.setZero();
    state_.a.setZero();
    return;
  }
  state_.slow_down(rate_change);
}

double LiveReference::error_of(const VectorXd& q) const {
  return (state_.q - q).lpNorm<Eigen::Infinity>();
}

double LiveReference::time_near(const VectorXd& q) {
  const scene::JointTrajectory& trajectory = *goal_->trajectory;
  double nearest = ReferenceState::tracked_within, found_s = -1.0;
  for (Index i = point_; i + 1 < trajectory.points(); ++i) {
    offset_ = trajectory.q.col(i + 1) - trajectory.q.col(i);
    between_ = q - trajectory.q.col(i);
    const double length = offset_.squaredNorm(),
                 share = length > 0.0 ? std::clamp(offset_.dot(between_) / length, 0.0, 1.0) : 0.0;
    between_ -= share * offset_;
    const double distance = between_.lpNorm<Eigen::Infinity>();
    if (found_s >= 0.0 && distance > nearest) break;  // the next time, not the nearest of all
    const double from = trajectory.time_s[i];
    const double time_s = from + share * (trajectory.time_s[i + 1] - from);
    if (distance > nearest || time_s <= state_.time_s) continue;
    nearest = distance;
    found_s = time_s;
  }
  return found_s;
}

}  // namespace hamelin::control

#include "loop/path_reference.hpp"

#include <algorithm>
#include <cmath>

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// Changes of the rate: where the arm is away from the reference, and at most [1/s].
constexpr double rate_fall = 10.0, rate_rise_most = 100.0;
// The share of what the limits leave that is used to get faster.
constexpr double rise_share = 0.95;
// Where the change of the rate may not jump, it falls with this time constant [s].
constexpr double settle_s = 0.05;

}  // namespace

PathReference::PathReference(Index dof) {
  state_.q = state_.v = state_.a = VectorXd::Zero(dof);
  state_.certified = true;
}

void PathReference::start(const CertifiedPath& path,
                          const timing::TimedPath::Place& place) noexcept {
  path_ = &path;
  started_ = false;
  cursor_ = {};
  state_.time_s = place.time_s;
  state_.rate = place.rate;
  rate_change_ = 0.0;
  state_.ended = false;
}

const ReferenceState& PathReference::update(const Now& now) {
  if (!started_) {
    evaluate();
  } else if (now.held_up) {
    const timing::TimedPath::Place place = path_->motion.project(
        now.q, now.v, {state_.time_s, state_.rate}, cursor_, state_.q, state_.v, state_.a);
    state_.time_s = place.time_s;
    state_.rate = std::min(place.rate, now.rate_max);
    rate_change_ = 0.0;
    evaluate();
  } else if (path_->braking_ramp > 0.0) {
    move_on_with_ramps(now.period_s, now.rate_max);
  } else {
    move_on(now.period_s, now.rate_max);
  }
  started_ = true;
  state_.error = (state_.q - now.q).lpNorm<Eigen::Infinity>();
  return state_;
}

void PathReference::move_on(double period_s, double rate_max) {
  const double before = state_.rate,
               wanted = std::min(rate_max, ReferenceState::rate_for(state_.error));
  if (wanted > before)
    state_.rate = std::min(wanted, before + period_s * largest_rise(rate_rise_most));
  else
    state_.rate = std::max(wanted, before - period_s * rate_fall);
  state_.time_s += 0.5 * period_s * (before + state_.rate);
  rate_change_ = (state_.rate - before) / period_s;
  evaluate();
}

void PathReference::move_on_with_ramps(double period_s, double rate_max) {
  const double before = state_.rate, step = period_s * path_->braking_ramp,
               left = std::min(rate_max, ReferenceState::rate_for(state_.error)) - before,
               most = std::min(largest_rise(rate_rise_most), settle_s * path_->braking_ramp),
               wanted = std::clamp(left / settle_s, -rate_fall, most);
  const double change = std::clamp(wanted, rate_change_ - step, rate_change_ + step);
  state_.rate = std::clamp(before + 0.5 * period_s * (rate_change_ + change), 0.0, 1.0);
  state_.time_s += 0.5 * period_s * (before + state_.rate);
  rate_change_ = (state_.rate - before) / period_s;
  evaluate();
}

// docs/theory.md (19.11)
double PathReference::largest_rise(double most) const {
  const timing::TimedPath& motion = path_->motion;
  const Index k = std::min(cursor_.node, motion.nodes() - 2);
  const double square = state_.rate * state_.rate;
  double u = motion.rate[k];
  const auto bound = [&](double a, double b, double rest, double limit, double speed) {
    const double slope = a * speed, value = square * (a * u + b * speed * speed) + rest;
    if (slope > 0.0) most = std::min(most, (limit - value) / slope);
    if (slope < 0.0) most = std::min(most, (-limit - value) / slope);
  };
  const timing::Limits& limits = path_->limits;
  for (const Index node : {k, k + 1}) {
    const double speed = motion.speed[node];
    for (Index j = 0; j < limits.torque.size(); ++j)
      bound(motion.inertia(j, node), motion.bias(j, node), motion.gravity(j, node),
            limits.torque[j], speed);
    for (Index j = 0; j < limits.acceleration.size(); ++j)
      bound(motion.tangent(j, node), motion.curvature(j, node), 0.0, limits.acceleration[j], speed);
    u = motion.rate_at_end(k);
  }
  return std::max(0.0, rise_share * most);
}

void PathReference::evaluate() {
  const double end = path_->motion.duration_s();
  state_.ended = state_.time_s >= end;
  state_.time_s = std::min(state_.time_s, end);
  path_->motion.at(state_.time_s, state_.q, state_.v, state_.a, cursor_);
  if (state_.ended) {
    state_.v.setZero();
    state_.a.setZero();
    return;
  }
  state_.slow_down(rate_change_);
}

}  // namespace hamelin::control

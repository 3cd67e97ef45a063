#include "loop/stop_finder.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

#include "hamelin/control/planner_setup.hpp"

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// An arm whose limits allow no stop brakes at this rate, and is limited afterwards [1/s].
constexpr double forced_rate = 20.0;
constexpr double stop_steps = 4.0, unlimited_stop_steps = 10.0;
// A stop begins to brake before it ends to: the largest product of its rate and of both transitions
// is below 2, docs/theory.md (14.13).
constexpr double longest_transitions = 1.9;

BrakingRate braking_within(const scene::Scene& scene, const model::Model& model, double period_s,
                           const ChangeBounds& bounds) {
  const VectorXd effort_max = modelled_limits(scene, model.robot()).effort_max;
  return {model, scene::safety_bounds(scene).torque_share * effort_max, bounds.acceleration_max,
          1.0 / StopFinder::least_time_s(effort_max.size() > 0, period_s)};
}

}  // namespace

double StopFinder::least_time_s(bool torque_limits, double period_s) noexcept {
  return period_s * (torque_limits ? stop_steps : unlimited_stop_steps);
}

StopFinder::StopFinder(const scene::Scene& scene, const model::Model& model, double period_s,
                       const ChangeBounds& bounds)
    : model_(model),
      bounds_(bounds),
      braking_(braking_within(scene, model, period_s, bounds)),
      ws_(model) {
  for (auto* x : {&w_, &q_, &rate_, &torque_}) x->setZero(model.dof());
}

std::pair<double, double> StopFinder::transition_times(const Start& start, double rate) {
  double ramp = 0.0, fade = 0.0;
  if (bounds_.torque_rate > 0.0) {
    const double torque_rate = ramp_share * bounds_.torque_rate;
    rate_ = -rate * w_ - start.disturbance;
    dynamics::inverse_dynamics(model_, ws_, start.q, w_, rate_, torque_);
    ramp = (torque_ - start.torque).cwiseAbs().maxCoeff() / torque_rate;
    dynamics::momentum(model_, ws_, start.q, w_, torque_);
    fade = rate * torque_.cwiseAbs().maxCoeff() / torque_rate;
  }
  for (Index j = 0; j < bounds_.jerk_max.size(); ++j) {
    ramp = std::max(ramp, std::abs(start.acceleration[j] + rate * w_[j]) / bounds_.jerk_max[j]);
    fade = std::max(fade, std::abs(rate * w_[j]) / bounds_.jerk_max[j]);
  }
  return {ramp, fade};
}

// The ramp leads to the velocity w, from which the arm brakes, and w decides how long the ramp must
// be. Each try solves for the ramp as if this were linear.
void StopFinder::keep_bounds(const Start& start, double& rate, double& ramp, double& fade) {
  constexpr int tries = 10;
  for (int i = 0; i < tries; ++i) {
    double slope = 0.0;  // of the ramp that is needed, by the ramp
    for (Index j = 0; j < w_.size(); ++j) {
      if (w_[j] != 0.0) rate = std::min(rate, bounds_.acceleration_max[j] / std::abs(w_[j]));
      slope = std::max(slope, 0.5 * rate * std::abs(start.acceleration[j]) / bounds_.jerk_max[j]);
    }
    double needed = 0.0;
    std::tie(needed, fade) = transition_times(start, rate);
    if (needed <= ramp) return;
    ramp += (needed - ramp) / (1.0 - std::min(slope, 0.9));
    rate = std::min(rate, longest_transitions / (ramp + fade));
    w_ = start.v + 0.5 * ramp * start.acceleration;
  }
}

// The rate of braking and the time to reach it depend on each other.
bool StopFinder::find(const Start& start, double least_utilisation, FailSafe& out) {
  constexpr int tries = 3;
  constexpr double whole = 1.0;  // of docs/theory.md (14.13)
  double ramp = 0.0, fade = 0.0, rate = 0.0;
  w_ = start.v;
  for (int i = 0; i < tries; ++i) {
    q_ = start.q + ramp * start.v;
    const std::optional<double> found = braking_.find(q_, w_, least_utilisation);
    if (!found) return false;
    rate = *found;
    if (bounds_.torque_rate == 0.0 && bounds_.jerk_max.size() == 0) break;
    std::tie(ramp, fade) = transition_times(start, rate);
    // faster braking would take longer to begin
    for (int k = 0; k < tries && rate * (ramp + fade) > whole; ++k) {
      rate *= std::sqrt(whole / (rate * (ramp + fade)));
      std::tie(ramp, fade) = transition_times(start, rate);
    }
    rate = std::min(rate, longest_transitions * whole / (ramp + fade));
    w_ = start.v + 0.5 * ramp * start.acceleration;
  }
  if (bounds_.jerk_max.size() > 0) keep_bounds(start, rate, ramp, fade);
  out.set_stop(start.q, start.v, start.acceleration, {rate, ramp, fade});
  return true;
}

void StopFinder::force(const Start& start, FailSafe& out) {
  double rate = forced_rate, ramp = 0.0, fade = 0.0;
  w_ = start.v;
  if (bounds_.jerk_max.size() > 0) keep_bounds(start, rate, ramp, fade);
  out.set_stop(start.q, start.v, start.acceleration, {rate, ramp, fade});
}

}  // namespace hamelin::control

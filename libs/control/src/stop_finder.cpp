#include "hamelin/control/stop_finder.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

#include "hamelin/control/planner_setup.hpp"

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

constexpr double stop_steps = 4.0, unlimited_stop_steps = 10.0;

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
    if (rate * (ramp + fade) > 1.9 * whole) rate = 1.9 * whole / (ramp + fade);
    w_ = start.v + 0.5 * ramp * start.acceleration;
  }
  out.set_stop(start.q, start.v, start.acceleration, {rate, ramp, fade});
  return true;
}

}  // namespace hamelin::control

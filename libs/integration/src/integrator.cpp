#include <algorithm>

#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

Integrator::Integrator(std::string name, const Model& model, const Options& options)
    : model_(model), options_(options), ws_(model), name_(std::move(name)), velocity_(VectorXd::Zero(model.dof())) {}

State Integrator::start(const VectorXd& q0, const VectorXd& v0) {
  State state;
  state.q = q0;
  begin(state, v0);
  make_room(state);
  return state;
}

void Integrator::kick(State& state, const VectorXd& dp) {
  add_momentum(state, dp);
  state.jumped = true;
}

void Integrator::set_velocity(State& state, const VectorXd& v) {
  replace_velocity(state, v);
  state.jumped = true;
}

StepReport together(const StepReport& a, const StepReport& b) {
  StepReport sum = a;
  sum.converged = a.converged && b.converged;
  sum.updates += b.updates;
  sum.factorizations += b.factorizations;
  sum.evaluations += b.evaluations;
  sum.halvings += b.halvings;
  sum.rejected += b.rejected;
  sum.step_s += b.step_s;
  sum.residual = std::max(a.residual, b.residual);
  sum.gyroscopic_work_J += b.gyroscopic_work_J;
  sum.dissipated_J += b.dissipated_J;
  sum.held_work_J += b.held_work_J;
  return sum;
}

namespace {

// What a failed step reports is its cost: it moved nothing, so it did no work. Reports are changed where they stand, so
// that they are handed on without copies.
void take_back(StepReport& report) {
  report.converged = false;
  report.step_s = report.gyroscopic_work_J = report.dissipated_J = report.held_work_J = 0.0;
}

}  // namespace

void Integrator::make_room(const State& state) {
  if (saved_.empty()) saved_.assign(static_cast<std::size_t>(options_.max_halvings) + 1, state);
}

StepReport Integrator::step(State& state, const Channels& channels, double h) {
  if (adaptive()) return parts(state, channels, h);
  return advance(state, channels, h);
}

// Exactly h ahead under step control.
StepReport Integrator::parts(State& state, const Channels& channels, double h) {
  make_room(state);
  saved_[0] = state;
  StepReport report;
  for (double left = h; left > 0.0 && report.converged;) {
    const StepReport part = advance(state, channels, left);
    // the last part ends at h itself, not a rounding error before it
    left = part.step_s == left ? 0.0 : left - part.step_s;
    report = together(report, part);
  }
  if (report.converged) {
    report.step_s = h;
    state.k = saved_[0].k + 1;
    state.time_s = saved_[0].time_s + h;
  } else {
    state = saved_[0];
    take_back(report);
  }
  return report;
}

StepReport Integrator::advance(State& state, const Channels& channels, double limit) {
  make_room(state);
  StepReport report = adaptive() ? controlled(state, channels, limit) : divide(state, channels, limit, 0);
  if (report.converged) {
    state.jumped = false;
    ++state.k;
    state.time_s += report.step_s;
  } else {
    take_back(report);
  }
  return report;
}

StepReport Integrator::controlled(State&, const Channels&, double) {
  StepReport report;
  report.converged = false;
  return report;
}

StepReport Integrator::divide(State& state, const Channels& channels, double h, int depth) {
  StepReport report = attempt(state, channels, h);
  report.step_s = h;
  if (report.converged) {
    state.jumped = false;  // for the other half
  } else {
    take_back(report);
    if (depth < options_.max_halvings) halve(state, channels, h, depth, report);
  }
  return report;
}

// The channels stay as they are, so the planner is not asked again.
void Integrator::halve(State& state, const Channels& channels, double h, int depth, StepReport& report) {
  State& before = saved_[static_cast<std::size_t>(depth)];
  before = state;
  report.converged = true;
  report.residual = 0.0;
  ++report.halvings;
  for (int half = 0; half < 2 && report.converged; ++half)
    report = together(report, divide(state, channels, 0.5 * h, depth + 1));
  if (report.converged) return;
  state = before;
  take_back(report);
}

Energy Integrator::energy(const State& state) {
  velocity(state, velocity_);
  return {dynamics::kinetic_energy(model_, ws_, state.q, velocity_), dynamics::potential_energy(model_, ws_, state.q)};
}

}  // namespace hamelin::integration

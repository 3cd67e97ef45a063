#include <algorithm>

#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

Integrator::Integrator(std::string name, const Model& model, const Options& options)
    : model_(model), options_(options), ws_(model), name_(std::move(name)), velocity_(VectorXd::Zero(model.dof())) {}

State Integrator::start(const VectorXd& q0, const VectorXd& v0) {
  State state;
  state.q = q0;
  begin(state, v0);
  if (saved_.empty()) saved_.assign(static_cast<std::size_t>(options_.max_halvings) + 1, state);
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

/// What a failed step reports: its cost. It moved nothing, so it did no work.
StepReport failed(StepReport report) {
  report.converged = false;
  report.step_s = report.gyroscopic_work_J = report.dissipated_J = report.held_work_J = 0.0;
  return report;
}

}  // namespace

StepReport Integrator::step(State& state, const Channels& channels, double h) {
  if (saved_.empty()) saved_.assign(static_cast<std::size_t>(options_.max_halvings) + 1, state);
  const long k = state.k;
  const double time = state.time_s;
  StepReport report;
  if (adaptive()) {
    saved_[0] = state;
    for (double left = h; left > 0.0 && report.converged;) {
      const StepReport part = advance(state, channels, left);
      // the last part ends at h itself, not a rounding error before it
      left = part.step_s == left ? 0.0 : left - part.step_s;
      report = together(report, part);
    }
    if (!report.converged) {
      state = saved_[0];
      return failed(report);
    }
    report.step_s = h;
  } else {
    report = advance(state, channels, h);
    if (!report.converged) return report;
  }
  state.k = k + 1;
  state.time_s = time + h;
  return report;
}

StepReport Integrator::advance(State& state, const Channels& channels, double limit) {
  if (saved_.empty()) saved_.assign(static_cast<std::size_t>(options_.max_halvings) + 1, state);
  StepReport report = adaptive() ? controlled(state, channels, limit) : divide(state, channels, limit, 0);
  if (!report.converged) return failed(report);
  state.jumped = false;
  ++state.k;
  state.time_s += report.step_s;
  return report;
}

StepReport Integrator::controlled(State&, const Channels&, double) {
  StepReport report;
  report.converged = false;
  return report;
}

// Halves the step where no root is found; the channels stay as they are, so the planner is not asked again.
StepReport Integrator::divide(State& state, const Channels& channels, double h, int depth) {
  StepReport report = attempt(state, channels, h);
  report.step_s = h;
  if (report.converged) {
    state.jumped = false;  // for the other half
    return report;
  }
  report = failed(report);
  if (depth == options_.max_halvings) return report;
  State& before = saved_[static_cast<std::size_t>(depth)];
  before = state;
  StepReport total = report;
  total.converged = true;
  total.residual = 0.0;
  ++total.halvings;
  for (int half = 0; half < 2 && total.converged; ++half)
    total = together(total, divide(state, channels, 0.5 * h, depth + 1));
  if (total.converged) return total;
  state = before;
  return failed(total);
}

Energy Integrator::energy(const State& state) {
  velocity(state, velocity_);
  return {dynamics::kinetic_energy(model_, ws_, state.q, velocity_), dynamics::potential_energy(model_, ws_, state.q)};
}

}  // namespace hamelin::integration

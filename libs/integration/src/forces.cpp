#include <algorithm>

#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

Integrator::Integrator(std::string name, const Model& model, const Options& options)
    : model_(model), options_(options), ws_(model), force_(model.dof()), name_(std::move(name)) {
  held_ = damped_ = gyroscopic_ = VectorXd::Zero(model.dof());
}

State Integrator::start(const VectorXd& q0, const VectorXd& v0) {
  State state;
  state.q = q0;
  state.v = v0;
  state.p = VectorXd::Zero(model_.dof());
  state.force_previous = VectorXd::Zero(model_.dof());
  state.deltas.assign(4, VectorXd::Zero(model_.dof()));
  begin(state, v0);
  saved_.assign(static_cast<std::size_t>(options_.max_halvings) + 1, state);
  return state;
}

StepReport Integrator::step(State& state, const Channels& channels, double h) {
  if (saved_.empty()) saved_.assign(static_cast<std::size_t>(options_.max_halvings) + 1, state);
  const long k = state.k;
  const double time = state.time_s;
  const StepReport report = divide(state, channels, h, 0);
  if (!report.converged) {
    state = saved_[0];
    return report;
  }
  state.k = k + 1;
  state.time_s = time + h;
  return report;
}

// Halves the step where no root is found; the channels stay as they are, so the planner is not asked again.
StepReport Integrator::divide(State& state, const Channels& channels, double h, int depth) {
  State& before = saved_[static_cast<std::size_t>(depth)];
  before = state;
  StepReport report = attempt(state, channels, h);
  if (report.converged || depth == options_.max_halvings) return report;
  state = before;
  StepReport total = report;
  total.converged = true;
  total.residual = 0.0;
  total.gyroscopic_work_J = total.dissipated_J = total.held_work_J = 0.0;
  ++total.halvings;
  for (int half = 0; half < 2 && total.converged; ++half) {
    const StepReport part = divide(state, channels, 0.5 * h, depth + 1);
    total.converged = part.converged;
    total.updates += part.updates;
    total.factorizations += part.factorizations;
    total.evaluations += part.evaluations;
    total.halvings += part.halvings;
    total.residual = std::max(total.residual, part.residual);
    total.gyroscopic_work_J += part.gyroscopic_work_J;
    total.dissipated_J += part.dissipated_J;
    total.held_work_J += part.held_work_J;
  }
  return total;
}

void Integrator::evaluate_forces(const Channels& channels, const VectorXd& q, const VectorXd& v) {
  if (channels.held_torque.size() > 0)
    held_ = channels.held_torque;
  else
    held_.setZero();
  if (channels.damping.size() > 0)
    damped_ = channels.damping.cwiseProduct(v);
  else
    damped_.setZero();
  if (!channels.gyroscopic.empty())
    dynamics::gyroscopic_torque(model_, ws_, q, v, channels.gyroscopic, gyroscopic_);
  else
    gyroscopic_.setZero();
  force_ = held_ - damped_ + gyroscopic_;
}

void Integrator::book_work(StepReport& report, const VectorXd& displacement, double weight) const {
  report.held_work_J += weight * held_.dot(displacement);
  report.dissipated_J += weight * damped_.dot(displacement);
  report.gyroscopic_work_J += weight * gyroscopic_.dot(displacement);
}

Energy Integrator::energy(const State& state) {
  VectorXd& v = force_;  // scratch: no forces are pending between steps
  velocity(state, v);
  return {dynamics::kinetic_energy(model_, ws_, state.q, v), dynamics::potential_energy(model_, ws_, state.q)};
}

}  // namespace hamelin::integration

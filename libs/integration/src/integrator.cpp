#include <algorithm>
#include <cmath>

#include "channels/check_channels.hpp"
#include "channels/wrench_forces.hpp"
#include "finite.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"
#include "hamelin/integration/integrator.hpp"
#include "state_owner.hpp"

namespace hamelin::integration {

Integrator::Integrator(std::string name, const Model& model, const Settings& settings)
    : model_(model),
      settings_(settings),
      ws_(model, settings.isa),
      wrenches_(std::make_shared<WrenchForces>(model, ws_)),
      name_(std::move(name)),
      velocity_(VectorXd::Zero(model.dof())) {}

Integrator::~Integrator() = default;

double Integrator::tolerance() const noexcept {
  return adaptive() ? std::max(settings_.rtol, settings_.atol) : settings_.tolerance;
}

Integrator::Shape Integrator::shape_of(const State& state) noexcept {
  return {state.q.size(),
          state.v.size(),
          state.p.size(),
          state.memory.size(),
          state.force_previous.size(),
          state.history.size()};
}

void Integrator::check(const char* function, const State& state) const {
  const dynamics::detail::Call call(function, model_, ws_.owner);  // refuses a replaced model
  if (state.owner != owner_) [[unlikely]]
    refuse_owner(function, state, owner_, model_);
  if (shape_of(state) != shape_) [[unlikely]]
    refuse_shape(function, state);
}

void Integrator::refuse_shape(const char* function, const State& state) const {
  check_size(function, "state.q", model_, state.q.size());
  const Shape given = shape_of(state);
  throw Error(ErrorCode::usage, formatted("{}: state: {} velocities, {} momenta and {} numbers of "
                                          "memory given, expected {}, {} and {}: a "
                                          "state that '{}' with these options makes for this model",
                                          function, given.v, given.p, given.memory, shape_.v,
                                          shape_.p, shape_.memory, name_));
}

void Integrator::check(const char* function, const State& state, const Channels& channels,
                       double h) const {
  check(function, state);
  if (!channels.none()) check_channels(function, model_, channels);
  if (!(h > 0.0) || !std::isfinite(h)) [[unlikely]]
    throw Error(ErrorCode::usage,
                formatted("{}: a step of {} s given, expected a positive number", function, h));
}

State Integrator::start(const ConstVectorRef& q0, const ConstVectorRef& v0) {
  check_size("start", "q0", model_, q0.size());
  check_size("start", "v0", model_, v0.size());
  State state;
  check_finite("start", "q0", q0);
  check_finite("start", "v0", v0);
  state.owner = owner_;
  state.q = q0;
  begin(state, v0);
  return state;
}

void Integrator::prepare(const StateOwner& owner) {
  owner_ = owner;
  State state;
  state.owner = owner_;
  state.q = velocity_.setZero();
  begin(state, velocity_);
  shape_ = shape_of(state);
  saved_.assign(static_cast<std::size_t>(settings_.max_halvings) + 1, state);
}

void Integrator::velocity(const State& state, VectorRef v) const {
  check("velocity", state);
  check_size("velocity", "v", model_, v.size());
  node_velocity(state, v);
}

Energy Integrator::energy(const State& state) const {
  check("energy", state);
  return node_energy(state);
}

Energy Integrator::energy(const State& state, const ConstVectorRef& v) const {
  check("energy", state);
  check_size("energy", "v", model_, v.size());
  return node_energy(state, v);
}

void Integrator::kick(State& state, const ConstVectorRef& dp) {
  check("kick", state);
  check_size("kick", "dp", model_, dp.size());
  check_finite("kick", "dp", dp);
  add_momentum(state, dp);
  state.jumped = true;
}

void Integrator::set_velocity(State& state, const ConstVectorRef& v) {
  check("set_velocity", state);
  check_size("set_velocity", "v", model_, v.size());
  check_finite("set_velocity", "v", v);
  velocity_ = v;  // v may share memory with the state
  replace_velocity(state, velocity_);
  state.jumped = true;
}

StepReport merge(const StepReport& a, const StepReport& b) {
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
  sum.external_work_J += b.external_work_J;
  return sum;
}

namespace {

// A failed step reports its cost, but no motion and no work. Reports are changed in place to avoid
// copies.
void mark_failed(StepReport& report) {
  report.converged = false;
  report.step_s = report.gyroscopic_work_J = report.dissipated_J = report.held_work_J =
      report.external_work_J = 0.0;
}

}  // namespace

StepReport Integrator::step(State& state, const Channels& channels, double h) {
  check("step", state, channels, h);
  wrenches_->begin(channels);
  const StepReport report =
      adaptive() ? take_controlled_steps(state, channels, h) : take_step(state, channels, h);
  wrenches_->end();
  return report;
}

StepReport Integrator::take_controlled_steps(State& state, const Channels& channels, double h) {
  saved_[0] = state;
  StepReport report;
  for (double left = h; left > 0.0 && report.converged;) {
    const StepReport part = take_step(state, channels, left);
    report = merge(report, part);
    // the last part must end at exactly h
    const double rest = part.step_s == left ? 0.0 : left - part.step_s;
    report.converged = report.converged && rest < left;  // else the steps are lost in rounding
    left = rest;
  }
  if (report.converged) {
    report.step_s = h;
    state.k = saved_[0].k + 1;
    state.time_s = saved_[0].time_s + h;
  } else {
    state = saved_[0];
    mark_failed(report);
  }
  return report;
}

StepReport Integrator::advance(State& state, const Channels& channels, double limit) {
  check("advance", state, channels, limit);
  wrenches_->begin(channels);
  const StepReport report = take_step(state, channels, limit);
  wrenches_->end();
  return report;
}

StepReport Integrator::take_step(State& state, const Channels& channels, double limit) {
  StepReport report = adaptive() ? controlled_step(state, channels, limit)
                                 : attempt_or_halve(state, channels, limit, 0);
  if (report.converged) {
    state.jumped = false;
    ++state.k;
    state.time_s += report.step_s;
  } else {
    mark_failed(report);
  }
  return report;
}

StepReport Integrator::controlled_step(State&, const Channels&, double) {
  StepReport report;
  report.converged = false;
  return report;
}

StepReport Integrator::attempt_or_halve(State& state, const Channels& channels, double h,
                                        int depth) {
  StepReport report = attempt(state, channels, h);
  report.step_s = h;
  if (report.converged) {
    state.jumped = false;  // for the other half
  } else {
    mark_failed(report);
    if (depth < settings_.max_halvings) halve(state, channels, h, depth, report);
  }
  return report;
}

// docs/theory.md (4.30). The channels stay the same, so the planner is not called again.
void Integrator::halve(State& state, const Channels& channels, double h, int depth,
                       StepReport& report) {
  State& before = saved_[static_cast<std::size_t>(depth)];
  before = state;
  report.converged = true;
  report.residual = 0.0;
  ++report.halvings;
  for (int half = 0; half < 2 && report.converged; ++half)
    report = merge(report, attempt_or_halve(state, channels, 0.5 * h, depth + 1));
  if (report.converged) return;
  state = before;
  mark_failed(report);
}

Energy Integrator::node_energy(const State& state) const {
  node_velocity(state, velocity_);
  return node_energy(state, velocity_);
}

Energy Integrator::node_energy(const State& state, const ConstVectorRef& v) const {
  return {dynamics::kinetic_energy(model_, ws_, state.q, v),
          dynamics::potential_energy(model_, ws_, state.q)};
}

}  // namespace hamelin::integration

#include "gauss.hpp"

#include <algorithm>
#include <cmath>

#include "channels/kernel_arguments.hpp"
#include "finite.hpp"
#include "gauss_tableau.hpp"
#include "hamelin/core/formatted.hpp"
#include "hamelin/dynamics/kernel/dispatch.hpp"
#include "state_owner.hpp"
#include "step_controller.hpp"

namespace hamelin::integration {

namespace kernel {

HAMELIN_SELECT_KERNELS(GaussSet, gauss_set)

}  // namespace kernel

namespace {

constexpr int max_sweeps = 60;
// Where the structure mode stops [rad or m]. What an earlier stop leaves has a sign, and the energy
// drifts with it, docs/theory.md, chapter 5.
constexpr double structure_tolerance = 1e-18;
// The share of the allowed error that the iteration may leave, and the factor of docs/theory.md
// (5.14) for the estimate, which is cautious. Both were found by work and error on falling arms.
constexpr double iteration_share = 1e-3, estimate_share = 30.0;

}  // namespace

GaussLegendre::GaussLegendre(const Model& model, const GaussOptions& options)
    : Integrator(
          "gauss", model,
          {options.isa, options.max_halvings, options.tolerance, options.rtol, options.atol}),
      structure_(structure_mode(options)),
      tableau_(gauss_tableau(static_cast<std::size_t>(options.order / 2))),
      kernels_(&kernel::select_gauss_set(options.isa)),
      scratch_(
          dynamics::kernel::with_group(model, *kernels_, [&](const auto& entry, const auto& chain) {
            return entry.bytes(chain.links.size(), tableau_.stages);
          })) {
  spins_.reserve(reserved_spins);
  q_next_ = u_next_ = VectorXd::Zero(model.dof());
  const auto n = static_cast<std::size_t>(model.dof());
  memory_next_ = VectorXd::Zero(
      static_cast<Eigen::Index>(kernel::GaussMemory::size(form(), n, tableau_.stages)));
}

std::string GaussLegendre::criterion() const {
  if (adaptive()) return formatted("error <= {} + {} |q|, max", settings_.atol, settings_.rtol);
  return formatted("|error of delta|_inf <= {}", settings_.tolerance);
}

std::string GaussLegendre::mode() const {
  return structure_ ? "structure" : "accurate";
}

kernel::GaussMemory GaussLegendre::memory(VectorXd& numbers) const {
  return {numbers.data(), form(), static_cast<std::size_t>(model_.dof()), tableau_.stages};
}

// Nearly all fixed steps have the weights of the step before.
const kernel::GaussGuess& GaussLegendre::guess_for(double ratio, double older_at) {
  if (ratio != guess_ratio_ || older_at != guess_older_at_) {
    guess_ = gauss_guess(tableau_, ratio, older_at);
    guess_ratio_ = ratio;
    guess_older_at_ = older_at;
  }
  return guess_;
}

void GaussLegendre::begin(State& state, const ConstVectorRef& v0) {
  state.memory = memory_next_.setZero();
  rate_part(state) = VectorXd::Zero(model_.dof());
  replace_velocity(state, v0);
  if (adaptive()) ahead_ = state;
}

void GaussLegendre::node_velocity(const State& state, VectorRef v) const {
  if (structure_)
    dynamics::solve_mass(model_, ws_, state.q, state.p, v);
  else
    v = state.v;
}

void GaussLegendre::add_momentum(State& state, const ConstVectorRef& dp) {
  if (structure_) {
    state.p += dp;
  } else {
    dynamics::solve_mass(model_, ws_, state.q, dp, u_next_);
    state.v += u_next_;
  }
}

void GaussLegendre::replace_velocity(State& state, const ConstVectorRef& v) {
  if (structure_) {
    dynamics::momentum(model_, ws_, state.q, v, state.p);
    const auto n = model_.dof();
    VectorXd::Map(memory(state.memory).carry + n, n).setZero();  // of the sum for the old momentum
  } else {
    state.v = v;
  }
}

kernel::GaussOutcome GaussLegendre::solve(const State& state, const Channels& channels, double h,
                                          double tolerance, StepReport& report) {
  memory_next_ = state.memory;
  const kernel::GaussMemory memory_next = memory(memory_next_);
  const kernel::GaussGuess* guess = nullptr;
  if (state.step_previous > 0.0) guess = &guess_for(h / state.step_previous, *memory_next.older_at);
  const kernel::Forces forces = to_forces(model_, channels, spins_, *wrenches_);
  auto outcome = dynamics::kernel::with_group(
      model_, *kernels_, [&]<class Entry, class Chain>(const Entry& entry, const Chain& chain) {
        const kernel::GaussCall<Chain> call{
            .chain = chain,
            .tableau = tableau_,
            .form = form(),
            .h = h,
            .q = state.q.data(),
            .u = rate_part(state).data(),
            .q_next = q_next_.data(),
            .u_next = u_next_.data(),
            .memory = memory_next,
            .guess = guess,
            .h_before = state.step_previous,
            .jumped = state.jumped,
            .steady = !state.jumped && h == state.step_previous &&
                      *memory_next.older_at == tableau_.c[tableau_.stages - 1] - 1.0,
            .forces = forces,
            .tolerance = tolerance,
            .max_sweeps = max_sweeps};
        return entry.step(call, scratch_.get());
      });
  outcome.converged = outcome.converged && all_finite(q_next_) && all_finite(u_next_);
  report.updates += outcome.sweeps;
  report.evaluations += outcome.sweeps * static_cast<int>(tableau_.stages);
  return outcome;
}

void GaussLegendre::accept(State& state, const kernel::GaussOutcome& outcome, double h,
                           StepReport& report) {
  state.q.swap(q_next_);
  rate_part(state).swap(u_next_);
  state.memory.swap(memory_next_);
  state.step_previous = h;
  state.jumped = false;
  report_work(outcome.work, report);
}

StepReport GaussLegendre::attempt(State& state, const Channels& channels, double h) {
  StepReport report;
  const double tolerance = structure_ ? structure_tolerance : settings_.tolerance;
  const auto outcome = solve(state, channels, h, tolerance, report);
  report.residual = outcome.residual;
  report.converged = outcome.converged;
  if (report.converged) accept(state, outcome, h, report);
  return report;
}

// docs/theory.md (5.14), (5.15): the change e in the first sweep is the error of the guess,
// O(h^{s+3}), and the error of the step is estimated from it as e^{(2s+1)/(s+3)}. A first step has
// no guess, and after an impulse the guess belongs to another motion: such a step is judged by a
// second step of the same length, which is then dropped.
StepReport GaussLegendre::controlled_step(State& state, const Channels& channels, double limit) {
  StepReport report;
  report.converged = false;
  const double s = static_cast<double>(tableau_.stages);
  const double allowed =
      settings_.atol + settings_.rtol * std::max(1.0, state.q.lpNorm<Eigen::Infinity>());
  const double tolerance = std::max(iteration_share * allowed, 1e-15);
  const double target = std::pow(estimate_share * allowed, (s + 3.0) / (2.0 * s + 1.0));
  // The estimate is cautious: a step is accepted if half its length would meet the target.
  const StepController::Rule rule{s + 3.0, 0.5, 0.1, 4.0};
  const double accepted = target * std::pow(2.0, s + 3.0);
  const bool first = state.jumped;
  StepController control(rule, state, limit);
  while (control.has_try()) {
    const double h = control.step();
    auto outcome = solve(state, channels, h, tolerance, report);
    double error = outcome.starter_error / accepted;
    if (first && outcome.converged) {
      ahead_ = state;
      StepReport booked;
      accept(ahead_, outcome, h, booked);
      const auto judge = solve(ahead_, channels, h, tolerance, report);
      error = judge.starter_error / accepted;
      outcome.converged = judge.converged;
    }
    if (!control.accepts(outcome.converged ? error : std::nan(""))) continue;
    if (first) {
      q_next_ = ahead_.q;
      u_next_ = ahead_.v;
      memory_next_ = ahead_.memory;
    }
    accept(state, outcome, h, report);
    report.residual = outcome.residual;
    control.finish(state, report);
  }
  report.rejected = control.rejected();
  return report;
}

}  // namespace hamelin::integration

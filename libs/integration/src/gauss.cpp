#include "gauss.hpp"

#include <algorithm>
#include <cmath>

#include "finite.hpp"
#include "gauss_tableau.hpp"
#include "hamelin/core/formatted.hpp"
#include "hamelin/dynamics/kernel/dispatch.hpp"
#include "kernel_arguments.hpp"
#include "step_controller.hpp"

namespace hamelin::integration {

namespace kernel {

HAMELIN_SELECT_KERNELS(GaussSet, gauss_set)

}  // namespace kernel

namespace {

constexpr int max_sweeps = 60;
// The share of the tolerance to which the structure mode iterates. The error left at 1e-12 has a
// sign, and energy drifts with it (1e-10 J in 10⁵ steps of planar3).
constexpr double structure_share = 1e-2;
// The share of the allowed error that the iteration may leave, and the factor 3 of docs/theory.md
// (5.9) for the estimate, which is cautious. Both were found by work and error on falling arms.
constexpr double iteration_share = 1e-3, estimate_share = 3.0;

}  // namespace

GaussLegendre::GaussLegendre(const Model& model, const GaussOptions& options)
    : Momentum("gauss", model,
               {options.isa, options.max_halvings, options.tolerance, options.rtol, options.atol}),
      tableau_(gauss_tableau(static_cast<std::size_t>(options.order / 2))),
      kernels_(&kernel::select_gauss_set(options.isa)),
      memory_(
          dynamics::kernel::with_group(model, *kernels_, [&](const auto& entry, const auto& chain) {
            return entry.bytes(chain.links.size(), tableau_.stages);
          })) {
  spins_.reserve(reserved_spins);
  q_next_ = p_next_ = VectorXd::Zero(model.dof());
  slopes_ = VectorXd::Zero(2 * static_cast<Eigen::Index>(tableau_.stages) * model.dof());
}

std::string GaussLegendre::criterion() const {
  if (adaptive()) return formatted("error <= {} + {} |q|, max", settings_.atol, settings_.rtol);
  return formatted("|error of delta|_inf <= {}", settings_.tolerance);
}

std::string GaussLegendre::mode() const {
  return structure() ? "structure" : "accurate";
}

void GaussLegendre::begin(State& state, const ConstVectorRef& v0) {
  state.memory = slopes_;
  state.p = VectorXd::Zero(model_.dof());
  replace_velocity(state, v0);
  if (adaptive()) ahead_ = state;
}

kernel::GaussOutcome GaussLegendre::solve(const State& state, const Channels& channels, double h,
                                          double tolerance, StepReport& report) {
  slopes_ = state.memory;
  const kernel::Forces forces = to_forces(model_, channels, spins_);
  auto outcome = dynamics::kernel::with_group(
      model_, *kernels_, [&]<class Entry, class Chain>(const Entry& entry, const Chain& chain) {
        const kernel::GaussCall<Chain> call{chain,          tableau_,       h,
                                            state.q.data(), state.p.data(), q_next_.data(),
                                            p_next_.data(), slopes_.data(), state.step_previous,
                                            state.jumped,   forces,         tolerance,
                                            max_sweeps};
        return entry.step(call, memory_.get());
      });
  outcome.converged = outcome.converged && all_finite(q_next_) && all_finite(p_next_);
  report.updates += outcome.sweeps;
  report.evaluations += outcome.sweeps * static_cast<int>(tableau_.stages);
  return outcome;
}

void GaussLegendre::accept(State& state, const kernel::GaussOutcome& outcome, double h,
                           StepReport& report) {
  state.q = q_next_;
  state.p = p_next_;
  state.memory = slopes_;
  state.step_previous = h;
  state.jumped = false;
  report_work(outcome.work, report);
}

StepReport GaussLegendre::attempt(State& state, const Channels& channels, double h) {
  StepReport report;
  const double tolerance = (structure() ? structure_share : 1.0) * settings_.tolerance;
  const auto outcome = solve(state, channels, h, tolerance, report);
  report.residual = outcome.residual;
  report.converged = outcome.converged;
  if (report.converged) accept(state, outcome, h, report);
  return report;
}

// docs/theory.md (5.9), (5.10): the change e in the first sweep is the error of the guess,
// O(h^{s+1}), and the error of the step is estimated from it as e^{(2s+1)/(s+1)}. A first step has
// no guess, and after an impulse the guess belongs to another motion: such a step is judged by a
// second step of the same length, which is then dropped.
StepReport GaussLegendre::controlled_step(State& state, const Channels& channels, double limit) {
  StepReport report;
  report.converged = false;
  const double s = static_cast<double>(tableau_.stages);
  const double allowed =
      settings_.atol + settings_.rtol * std::max(1.0, state.q.lpNorm<Eigen::Infinity>());
  const double tolerance = std::max(iteration_share * allowed, 1e-15);
  const double target = std::pow(estimate_share * allowed, (s + 1.0) / (2.0 * s + 1.0));
  // The estimate is cautious: a step is accepted if half its length would meet the target.
  const StepController::Rule rule{s + 1.0, 0.5, 0.1, 4.0};
  const double accepted = target * std::pow(2.0, s + 1.0);
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
      p_next_ = ahead_.p;
      slopes_ = ahead_.memory;
    }
    accept(state, outcome, h, report);
    report.residual = outcome.residual;
    control.finish(state, report);
  }
  report.rejected = control.rejected();
  return report;
}

}  // namespace hamelin::integration

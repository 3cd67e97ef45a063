#include "variational.hpp"

#include <cmath>

#include "channels/kernel_arguments.hpp"
#include "finite.hpp"
#include "hamelin/core/formatted.hpp"
#include "hamelin/dynamics/kernel/dispatch.hpp"

namespace hamelin::integration {

namespace kernel {

HAMELIN_SELECT_KERNELS(VariationalSet, variational_set)

}  // namespace kernel

namespace {

// The smallest tolerance at which a step may be accepted unconfirmed, docs/theory.md (4.28): with
// smaller ones energy would drift (measured).
constexpr double least_unconfirmed_tolerance = 1e-10;

}  // namespace

Variational::Variational(const Model& model, const VariationalOptions& options)
    : Momentum(
          "hamel-variational", model,
          {options.isa, options.max_halvings,
           options.solver == Solver::feedback ? options.feedback_tolerance : options.tolerance}),
      options_(options),
      kernels_(&kernel::select_variational_set(options.isa)),
      memory_(dynamics::kernel::with_group(
          model, *kernels_,
          [](const auto& entry, const auto& chain) { return entry.bytes(chain.links.size()); })) {
  for (auto* x : {&delta_, &p_, &p_next_, &correction_, &residual_, &gradient_})
    *x = VectorXd::Zero(model.dof());
  spins_.reserve(reserved_spins);
  gradient_at_ = VectorXd::Constant(model.dof(), std::nan(""));
}

bool Variational::accepts_unconfirmed() const noexcept {
  return options_.solver == Solver::newton && options_.tolerance >= least_unconfirmed_tolerance;
}

std::string Variational::criterion() const {
  if (options_.solver == Solver::feedback)
    return formatted("|tau_e|_2 < {}", options_.feedback_tolerance);
  if (accepts_unconfirmed())
    return formatted("|error of delta|_inf <= {}, or 10 |first correction|^2 <= it, unconfirmed",
                     options_.tolerance);
  return formatted("|error of delta|_inf <= {}", options_.tolerance);
}

std::string Variational::mode() const {
  return options_.solver == Solver::newton && options_.tolerance <= 1e-12 ? "structure"
                                                                          : "accurate";
}

// A step ends where the next one starts, so ∂U is computed once per node.
const VectorXd& Variational::gradient(const VectorXd& q) {
  if (q != gradient_at_) {
    dynamics::gravity_torque(model_, ws_, q, gradient_);
    gradient_at_ = q;
  }
  return gradient_;
}

template <class F>
kernel::VariationalOutcome Variational::with_call(const State& state, double h, F&& f) {
  return dynamics::kernel::with_group(
      model_, *kernels_, [&]<class Entry, class Chain>(const Entry& entry, const Chain& chain) {
        const kernel::VariationalCall<Chain> call{chain,
                                                  h,
                                                  state.q.data(),
                                                  p_.data(),
                                                  delta_.data(),
                                                  p_next_.data(),
                                                  forces_,
                                                  options_.tolerance,
                                                  accepts_unconfirmed()};
        return f(entry, call);
      });
}

kernel::VariationalOutcome Variational::solve_newton(const State& state, double h) {
  state.history[0].guess(h, delta_);
  return with_call(state, h, [&](const auto& entry, const auto& call) {
    return entry.step(call, memory_.get());
  });
}

kernel::VariationalOutcome Variational::solve_feedback(const State& state, double h) {
  delta_.setZero();  // the published guess θ^{k+1} = θ^k
  int updates = 0;
  for (;;) {
    auto out = with_call(state, h, [&](const auto& entry, const auto& call) {
      return entry.evaluate(call, memory_.get(), residual_.data());
    });
    out.updates = out.factorizations = updates;
    out.evaluations = updates + 1;
    out.residual = residual_.norm() / std::abs(h);  // ‖τ_e‖
    out.converged = out.residual < options_.feedback_tolerance;
    if (out.converged || !std::isfinite(out.residual) || updates == options_.max_updates)
      return out;
    residual_ *= -h;  // docs/theory.md (4.29)
    dynamics::solve_mass(model_, ws_, state.q, residual_, correction_);
    delta_ += correction_;
    ++updates;
  }
}

StepReport Variational::attempt(State& state, const Channels& channels, double h) {
  p_ = state.p - 0.5 * h * gradient(state.q);
  forces_ = to_forces(model_, channels, spins_, *wrenches_);
  const auto out =
      options_.solver == Solver::newton ? solve_newton(state, h) : solve_feedback(state, h);
  StepReport report;
  report.converged = out.converged && all_finite(delta_) && all_finite(p_next_);
  report.updates = out.updates;
  report.factorizations = out.factorizations;
  report.evaluations = out.evaluations;
  report.residual = out.residual;
  report_work(out.work, report);
  if (!report.converged) return report;
  state.q += delta_;
  state.p = p_next_ - 0.5 * h * gradient(state.q);
  state.history[0].record(h, delta_);
  return report;
}

}  // namespace hamelin::integration

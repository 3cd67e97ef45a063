#include "gauss.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "finite.hpp"
#include "hamelin/dynamics/kernel/dispatch.hpp"
#include "kernel_arguments.hpp"

namespace hamelin::integration {

namespace kernel {

HAMELIN_SELECT_KERNELS(GaussSet, gauss_set)

namespace {

// Nodes are the roots of the Legendre polynomial P_s on [0, 1], by Newton; a_ij = ∫₀^{c_i} ℓ_j, which Gauss quadrature
// of the same nodes does exactly. In long double, so that the rounded numbers are right.
GaussTableau tableau(std::size_t s) {
  using Real = long double;
  GaussTableau t{};
  t.stages = s;
  Real x[most_stages], w[most_stages];
  for (std::size_t i = 0; i < s; ++i) {
    Real z = std::cos(std::numbers::pi_v<Real> * (static_cast<Real>(i) + 0.75L) / (static_cast<Real>(s) + 0.5L));
    Real slope = 1.0L;
    for (int newton = 0; newton < 50; ++newton) {
      Real before = 1.0L, value = z;
      for (std::size_t j = 2; j <= s; ++j) {
        const auto k = static_cast<Real>(j);
        const Real next = ((2.0L * k - 1.0L) * z * value - (k - 1.0L) * before) / k;
        before = value;
        value = next;
      }
      slope = static_cast<Real>(s) * (z * value - before) / (z * z - 1.0L);
      z -= value / slope;
    }
    x[s - 1 - i] = 0.5L * (1.0L + z);
    w[s - 1 - i] = 1.0L / ((1.0L - z * z) * slope * slope);
  }
  const auto basis = [&](std::size_t j, Real at) {
    Real value = 1.0L;
    for (std::size_t m = 0; m < s; ++m)
      if (m != j) value *= (at - x[m]) / (x[j] - x[m]);
    return value;
  };
  for (std::size_t j = 0; j < s; ++j) {
    t.b[j] = static_cast<double>(w[j]);
    Real apart = 1.0L;
    for (std::size_t m = 0; m < s; ++m)
      if (m != j) apart *= x[j] - x[m];
    t.barycentric[j] = static_cast<double>(1.0L / apart);
    for (std::size_t i = 0; i < most_stages; ++i) {
      const Real c = x[i < s ? i : 0];
      Real a = 0.0L;
      for (std::size_t m = 0; m < s; ++m) a += w[m] * c * basis(j, c * x[m]);
      t.a_column[j][i] = static_cast<double>(a);
      t.c[i] = static_cast<double>(c);
    }
  }
  return t;
}

}  // namespace

}  // namespace kernel

namespace {

constexpr int default_order = 8;
constexpr int max_sweeps = 60;
constexpr int max_rejections = 60;
// What an iteration stopped at 1e-12 leaves has a sign, and energy drifts with it (1e-10 J in 10⁵ steps of planar3); a
// sweep more for structure's sake.
constexpr double to_rounding = 1e-2;
// How far a step may follow the last one.
constexpr double most = 4.0, least = 0.5;
// Of the step error that is allowed, what the iteration may leave; and how much of the estimate, which is a cautious
// one, the step may use. Both found by work and error on falling arms.
constexpr double iteration_share = 1e-3, estimate_share = 3.0;

}  // namespace

GaussLegendre::GaussLegendre(const Model& model, const Options& options)
    : Momentum("gauss", model, options),
      tableau_(kernel::tableau(static_cast<std::size_t>((options.order == 0 ? default_order : options.order) / 2))),
      kernels_(&kernel::selected_gauss_set()),
      memory_(dynamics::kernel::with_group(model, *kernels_, [&](const auto& entry, const auto& chain) {
        return entry.bytes(chain.links.size(), tableau_.stages);
      })) {
  spins_.reserve(most_spins);
  q_next_ = p_next_ = VectorXd::Zero(model.dof());
  slopes_ = VectorXd::Zero(2 * model.dof() * static_cast<Eigen::Index>(tableau_.stages));
}

std::string GaussLegendre::criterion() const {
  if (adaptive()) return fmt::format("error <= {} + {} |q|, max", options_.atol, options_.rtol);
  return fmt::format("|error of delta|_inf <= {}", options_.tolerance);
}

std::string GaussLegendre::mode() const {
  return structure() ? "structure" : "accurate";
}

void GaussLegendre::begin(State& state, const VectorXd& v0) {
  state.memory = slopes_;
  state.p = VectorXd::Zero(model_.dof());
  replace_velocity(state, v0);
  if (adaptive()) ahead_ = state;
}

kernel::GaussOutcome GaussLegendre::solve(const State& state, const Channels& channels, double h, double tolerance,
                                          StepReport& report) {
  slopes_ = state.memory;
  to_spins(model_, channels.gyroscopic, spins_);
  auto outcome = dynamics::kernel::with_group(model_, *kernels_,
                                              [&]<class Entry, class Chain>(const Entry& entry, const Chain& chain) {
                                                const kernel::GaussCall<Chain> call{chain,
                                                                                    tableau_,
                                                                                    h,
                                                                                    state.q.data(),
                                                                                    state.p.data(),
                                                                                    q_next_.data(),
                                                                                    p_next_.data(),
                                                                                    slopes_.data(),
                                                                                    state.step_previous,
                                                                                    state.jumped,
                                                                                    data_or_null(channels.damping),
                                                                                    data_or_null(channels.coulomb),
                                                                                    data_or_null(channels.held_torque),
                                                                                    channels.coulomb_speed,
                                                                                    spins_.data(),
                                                                                    spins_.size(),
                                                                                    tolerance,
                                                                                    max_sweeps};
                                                return entry.step(call, memory_.get());
                                              });
  outcome.converged = outcome.converged && all_finite(q_next_) && all_finite(p_next_);
  report.updates += outcome.sweeps;
  report.evaluations += outcome.sweeps * static_cast<int>(tableau_.stages);
  return outcome;
}

void GaussLegendre::accept(State& state, const kernel::GaussOutcome& outcome, double h, StepReport& report) {
  state.q = q_next_;
  state.p = p_next_;
  state.memory = slopes_;
  state.step_previous = h;
  state.jumped = false;
  report.held_work_J = outcome.held_work;
  report.dissipated_J = outcome.dissipated;
  report.gyroscopic_work_J = outcome.gyroscopic_work;
}

StepReport GaussLegendre::attempt(State& state, const Channels& channels, double h) {
  StepReport report;
  const double tolerance = (structure() ? to_rounding : 1.0) * options_.tolerance;
  const auto outcome = solve(state, channels, h, tolerance, report);
  report.residual = outcome.residual;
  report.converged = outcome.converged;
  if (report.converged) accept(state, outcome, h, report);
  return report;
}

// The guess is the last step's polynomial of degree s, so what the first sweep changes, e, is its error O(h^{s+1}),
// while the step's own is O(h^{2s+1}): relative to the displacement scale 1 it is taken for e^{(2s+1)/(s+1)}. It costs
// nothing, and it sees a motion that quickens one step late at most. The first step has no guess, and after an impulse
// the guess is of a motion that ended there: such a step is judged by a second one like it, which is then dropped.
StepReport GaussLegendre::controlled(State& state, const Channels& channels, double limit) {
  StepReport report;
  report.converged = false;
  const double s = static_cast<double>(tableau_.stages);
  const double allowed = options_.atol + options_.rtol * std::max(1.0, state.q.lpNorm<Eigen::Infinity>());
  const double tolerance = std::max(iteration_share * allowed, 1e-15);
  const double target = std::pow(estimate_share * allowed, (s + 1.0) / (2.0 * s + 1.0));
  const auto wanted_after = [&](const kernel::GaussOutcome& outcome) {
    return outcome.starter_error > 0.0 ? std::pow(target / outcome.starter_error, 1.0 / (s + 1.0)) : most;
  };
  const bool first = state.jumped;
  const double wish = state.step_next > 0.0 ? state.step_next : limit;
  for (double h = std::min(wish, limit); report.rejected <= max_rejections;) {
    auto outcome = solve(state, channels, h, tolerance, report);
    double wanted = wanted_after(outcome);
    if (first && outcome.converged) {
      ahead_ = state;
      StepReport booked;
      accept(ahead_, outcome, h, booked);
      const auto judge = solve(ahead_, channels, h, tolerance, report);
      wanted = wanted_after(judge);
      outcome.converged = judge.converged;
    }
    if (!outcome.converged || wanted < least) {
      ++report.rejected;
      h *= outcome.converged ? std::clamp(wanted, 0.1, least) : least;
      continue;
    }
    double next = h * std::min(wanted, most);
    // A step that the limit cut short says nothing against the wish there was.
    if (report.rejected == 0 && h < wish) next = std::max(next, wish);
    if (first) {
      q_next_ = ahead_.q;
      p_next_ = ahead_.p;
      slopes_ = ahead_.memory;
    }
    accept(state, outcome, h, report);
    state.step_next = next;
    report.step_s = h;
    report.residual = outcome.residual;
    report.converged = true;
    break;
  }
  return report;
}

}  // namespace hamelin::integration

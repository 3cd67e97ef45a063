#include "lie_exact.hpp"

#include <limits>

#include "finite.hpp"
#include "hamelin/core/formatted.hpp"
#include "kernel/corrections.hpp"

namespace hamelin::integration {

namespace {

constexpr double largest_correction = 1.0;  // [rad or m]

}  // namespace

LieExact::LieExact(const Model& model, const LieExactOptions& options)
    : Momentum("lie-exact", model, {options.isa, options.max_halvings, options.tolerance}),
      options_(options),
      forces_(model, *wrenches_) {
  const auto n = static_cast<std::size_t>(model.dof());
  if (model.planar())
    links_ = kernel::LieScratch<dynamics::kernel::Planar<double>>(n);
  else
    links_ = kernel::LieScratch<dynamics::kernel::Spatial<double>>(n);
  for (auto* x :
       {&delta_, &correction_, &mid_, &rate_, &minus_, &plus_, &residual_, &gradient_, &q_next_})
    *x = VectorXd::Zero(model.dof());
}

template <class F>
decltype(auto) LieExact::with_links(F&& f) {
  if (model_.planar())
    return f(dynamics::kernel::Planar<double>{}, std::get<1>(model_.chain()), std::get<1>(links_));
  return f(dynamics::kernel::Spatial<double>{}, std::get<0>(model_.chain()), std::get<0>(links_));
}

std::string LieExact::criterion() const {
  return formatted("|error of delta|_inf <= {}", options_.tolerance);
}

bool LieExact::evaluate(const State& state, const Channels& channels, double h) {
  const bool found = with_links([&]<class Space>(Space, const auto& chain, auto& k) {
    return kernel::lie_left_momenta<Space>(chain, k, delta_.data(), h, minus_.data());
  });
  if (!found) return false;
  mid_ = state.q + 0.5 * delta_;
  rate_ = delta_ / h;
  forces_.evaluate(channels, ws_, mid_, rate_);
  residual_ = minus_ + 0.5 * h * (gradient_ - forces_.total()) - state.p;
  return all_finite(residual_);
}

bool LieExact::factor(const State& state, const Channels& channels, double h) {
  if (options_.solver == Solver::riqn) return true;
  return with_links([&]<class Space>(Space, const auto& chain, auto& k) {
    for (std::size_t i = 0; i < k.size(); ++i) {
      const auto j = static_cast<Eigen::Index>(i);
      k[i].after = Space::place(chain.links[i], state.q[j] + delta_[j]);
    }
    return kernel::lie_factor<Space>(
        chain, k, h, channels.damping.size() > 0 ? channels.damping.data() : nullptr);
  });
}

void LieExact::correct(const State& state, double h) {
  if (options_.solver == Solver::riqn) {
    correction_ = -h * residual_;
    dynamics::solve_mass(model_, ws_, state.q, correction_, correction_);
    return;
  }
  with_links([&]<class Space>(Space, const auto& chain, auto& k) {
    kernel::lie_correct<Space>(chain, k, residual_.data(), correction_.data());
  });
}

// As docs/theory.md (4.25): the kept factors turn the residual of a sweep into the error of Δ. A
// step that uses up its iterations has failed.
bool LieExact::solve(const State& state, const Channels& channels, double h, StepReport& report) {
  const bool riqn = options_.solver == Solver::riqn;
  constexpr double unbounded = std::numeric_limits<double>::infinity();  // RIQN may contract slowly
  kernel::Corrections corrections(
      riqn ? kernel::CorrectionRule{largest_correction, unbounded, 0.0, 0}
           : kernel::newton_rule(largest_correction, options_.tolerance));
  for (;;) {
    if (!evaluate(state, channels, h)) return false;
    ++report.evaluations;
    if (riqn || report.factorizations > 0) {
      correct(state, h);
      report.residual = largest_size(correction_);
      report.factorizations += riqn ? 1 : 0;
      if (report.residual <= options_.tolerance) {
        delta_ += correction_;
        return true;
      }
    }
    if (report.updates == (riqn ? options_.max_updates : kernel::max_newton_updates)) return false;
    if (!riqn) {
      if (!factor(state, channels, h)) return false;
      ++report.factorizations;
      correct(state, h);
    }
    if (!corrections.record(largest_size(correction_))) return false;
    delta_ += correction_;
    ++report.updates;
  }
}

StepReport LieExact::attempt(State& state, const Channels& channels, double h) {
  StepReport report;
  dynamics::gravity_torque(model_, ws_, state.q, gradient_);
  with_links([&]<class Space>(Space, const auto& chain, auto& k) {
    for (std::size_t i = 0; i < k.size(); ++i)
      k[i].before = Space::place(chain.links[i], state.q[static_cast<Eigen::Index>(i)]);
  });
  state.history[0].guess(h, delta_);
  report.converged = solve(state, channels, h, report);
  if (!report.converged) return report;
  forces_.add_work(report, rate_, h);  // over the displacement of the last evaluation
  q_next_ = state.q + delta_;
  with_links([&]<class Space>(Space, const auto& chain, auto& k) {
    for (std::size_t i = 0; i < k.size(); ++i)
      k[i].after = Space::place(chain.links[i], q_next_[static_cast<Eigen::Index>(i)]);
    kernel::lie_right_momenta<Space>(chain, k, delta_.data(), h, plus_.data());
  });
  // docs/theory.md (6.9), with p⁺ − R as in (4.26)
  dynamics::gravity_torque(model_, ws_, q_next_, mid_);
  plus_ += 0.5 * h * (forces_.total() - mid_) - residual_;
  report.converged = all_finite(q_next_) && all_finite(plus_);
  if (!report.converged) return report;
  state.q.swap(q_next_);
  state.p.swap(plus_);
  state.history[0].record(h, delta_);
  return report;
}

}  // namespace hamelin::integration

#include "hamel.hpp"

#include <cstring>

#include "finite.hpp"
#include "hamelin/core/formatted.hpp"

namespace hamelin::integration {

Hamel::Hamel(const Model& model, const HamelOptions& options) : Hamel(model, options, false) {}

Hamel::Hamel(const Model& model, const HamelMidpointOptions& options)
    : Hamel(model,
            {.start = options.start,
             .feedback_tolerance = options.feedback_tolerance,
             .max_updates = options.max_updates,
             .max_halvings = options.max_halvings,
             .isa = options.isa},
            true) {}

Hamel::Hamel(const Model& model, const HamelOptions& options, bool midpoint)
    : Integrator(midpoint ? "hamel-midpoint" : "hamel", model,
                 {options.isa, options.max_halvings, options.feedback_tolerance}),
      options_(options),
      midpoint_(midpoint),
      alpha_(midpoint ? 0.5 : options.alpha),
      forces_(model, *wrenches_) {
  const auto n = static_cast<std::size_t>(model.dof());
  if (model.planar())
    links_ = Links<dynamics::kernel::Planar<double>>(n);
  else
    links_ = Links<dynamics::kernel::Spatial<double>>(n);
  for (auto* x : {&delta_, &correction_, &mid_, &rate_, &residual_, &gradient_})
    *x = VectorXd::Zero(model.dof());
}

std::string Hamel::criterion() const {
  return formatted("|tau_e|_2 < {}", options_.feedback_tolerance);
}

template <class F>
decltype(auto) Hamel::with_links(F&& f) const {
  if (model_.planar())
    return f(dynamics::kernel::Planar<double>{}, std::get<1>(model_.chain()), std::get<1>(links_));
  return f(dynamics::kernel::Spatial<double>{}, std::get<0>(model_.chain()), std::get<0>(links_));
}

void Hamel::begin(State& state, const ConstVectorRef& v0) {
  state.p = state.force_previous = VectorXd::Zero(model_.dof());
  state.history.assign(1, StepHistory(model_.dof()));
  replace_velocity(state, v0);
}

void Hamel::replace_velocity(State& state, const ConstVectorRef& v) {
  state.p.setZero();  // the impulses at the node
  state.force_previous.setZero();
  state.step_previous = 0.0;
  // ξ' from the velocity, docs/theory.md (2.1)
  with_links([&]<class Space>(Space, const auto& chain, auto& k) {
    constexpr std::size_t width = sizeof(typename Space::Motion) / sizeof(double);
    state.memory.resize(static_cast<Eigen::Index>((width + 1) * k.size()));
    for (std::size_t i = 0; i < k.size(); ++i) {
      const auto& l = chain.links[i];
      const auto x = Space::place(l, state.q[static_cast<Eigen::Index>(i)]);
      k[i].twist = l.parent < 0
                       ? Space::zero_motion()
                       : Space::to_child(l, x, k[static_cast<std::size_t>(l.parent)].twist);
      Space::add_along_axis(l, k[i].twist, v[static_cast<Eigen::Index>(i)]);
      std::memcpy(state.memory.data() + width * i, &k[i].twist, sizeof(k[i].twist));
    }
  });
  state.memory.tail(v.size()) = v;  // joint rates that belong to ξ', for the rotors
}

void Hamel::add_momentum(State& state, const ConstVectorRef& dp) {
  state.p += dp;
}

void Hamel::load(const State& state, double h_before) const {
  with_links([&]<class Space>(Space, const auto& chain, auto& k) {
    constexpr std::size_t width = sizeof(typename Space::Motion) / sizeof(double);
    for (std::size_t i = 0; i < k.size(); ++i) {
      const auto& l = chain.links[i];
      typename Space::Motion twist;
      std::memcpy(&twist, state.memory.data() + width * i, sizeof(twist));
      k[i].x = Space::place(l, state.q[static_cast<Eigen::Index>(i)]);
      const auto mu = Space::momentum(l, twist);
      k[i].before = Space::scaled(
          Space::sum(mu, Space::scaled(Space::ad_T(twist, mu), alpha_ * h_before)), -1.0);
    }
  });
}

void Hamel::momentum_before(const State& state, VectorXd& p) const {
  load(state, state.step_previous);
  with_links([&]<class Space>(Space, const auto& chain, auto& k) {
    const double* const rate_before = state.memory.data() + state.memory.size() - model_.dof();
    for (std::size_t i = 0; i < k.size(); ++i) k[i].force = Space::scaled(k[i].before, -1.0);
    for (std::size_t i = k.size(); i-- > 0;) {
      const auto& l = chain.links[i];
      p[static_cast<Eigen::Index>(i)] =
          Space::along_axis(l, k[i].force) + rate_before[i] * l.armature;
      if (l.parent < 0) continue;
      auto& outer = k[static_cast<std::size_t>(l.parent)].force;
      outer = Space::sum(outer, Space::to_parent(l, k[i].x, k[i].force));
    }
  });
  if (state.step_previous > 0.0) {
    dynamics::gravity_torque(model_, ws_, state.q, gradient_);
    p += 0.5 * state.step_previous * (state.force_previous - gradient_);
  }
  p += state.p;
}

void Hamel::node_velocity(const State& state, VectorRef v) const {
  momentum_before(state, correction_);
  dynamics::solve_mass(model_, ws_, state.q, correction_, v);
}

Energy Hamel::node_energy(const State& state, const ConstVectorRef&) const {
  if (state.step_previous == 0.0) {
    rate_ = state.memory.tail(model_.dof());  // the velocity that was set
    return {dynamics::kinetic_energy(model_, ws_, state.q, rate_),
            dynamics::potential_energy(model_, ws_, state.q)};
  }
  const VectorXd& delta = state.history[0].last();
  rate_ = delta / state.step_previous;
  mid_ = state.q - 0.5 * delta;
  Energy energy{dynamics::kinetic_energy(model_, ws_, mid_, rate_), 0.0};
  mid_ = state.q - delta;
  energy.potential_J = 0.5 * (dynamics::potential_energy(model_, ws_, mid_) +
                              dynamics::potential_energy(model_, ws_, state.q));
  return energy;
}

void Hamel::evaluate(const State& state, const Channels& channels, double h, double h_before,
                     double h_force) {
  const double* const rate_before = state.memory.data() + state.memory.size() - model_.dof();
  rate_ = delta_ / h;
  mid_ = state.q + 0.5 * delta_;
  with_links([&]<class Space>(Space, const auto& chain, auto& k) {
    for (std::size_t i = 0; i < k.size(); ++i) {
      const auto& l = chain.links[i];
      const auto j = static_cast<Eigen::Index>(i);
      const auto transport = midpoint_ ? Space::place(l, mid_[j]) : k[i].x;
      k[i].twist = l.parent < 0
                       ? Space::zero_motion()
                       : Space::to_child(l, transport, k[static_cast<std::size_t>(l.parent)].twist);
      Space::add_along_axis(l, k[i].twist, rate_[j]);
      const auto mu = Space::momentum(l, k[i].twist);
      const auto turn = Space::scaled(Space::ad_T(k[i].twist, mu), -(1.0 - alpha_) * h);
      k[i].force = Space::sum(k[i].before, Space::sum(mu, turn));
    }
    for (std::size_t i = k.size(); i-- > 0;) {
      const auto& l = chain.links[i];
      const auto j = static_cast<Eigen::Index>(i);
      residual_[j] = Space::along_axis(l, k[i].force) + (rate_[j] - rate_before[i]) * l.armature;
      if (l.parent < 0) continue;
      auto& outer = k[static_cast<std::size_t>(l.parent)].force;
      outer = Space::sum(outer, Space::to_parent(l, k[i].x, k[i].force));
    }
  });
  forces_.evaluate(channels, ws_, mid_, rate_);
  residual_ += 0.5 * (h + h_before) * gradient_ - h_force * forces_.total() -
               0.5 * h_before * state.force_previous - state.p;
}

StepReport Hamel::attempt(State& state, const Channels& channels, double h) {
  StepReport report;
  report.converged = false;
  // docs/theory.md (3.14): the published start counts the whole potential at k = 0, as if a step of
  // the same length had ended there.
  const bool whole_node =
      state.k == 0 && state.step_previous == 0.0 && options_.start == Start::published;
  const double h_before = whole_node ? h : state.step_previous;
  const double h_force = whole_node ? h : 0.5 * h;
  load(state, h_before);
  dynamics::gravity_torque(model_, ws_, state.q, gradient_);
  delta_.setZero();  // the published guess θ^{k+1} = θ^k
  for (;;) {
    evaluate(state, channels, h, h_before, h_force);
    ++report.evaluations;
    report.residual = residual_.norm() / h;  // ‖τ_e‖
    if (!std::isfinite(report.residual)) return report;
    if (report.residual < options_.feedback_tolerance) break;
    if (report.updates == options_.max_updates) return report;
    residual_ *= -h;
    dynamics::solve_mass(model_, ws_, state.q, residual_, correction_);  // docs/theory.md (3.9)
    delta_ += correction_;
    ++report.updates;
    ++report.factorizations;
  }
  report.converged = all_finite(delta_) && all_finite(rate_) && all_finite(forces_.total());
  if (!report.converged) return report;
  forces_.add_work(report, delta_, 1.0);
  with_links([&]<class Space>(Space, const auto&, auto& k) {
    constexpr std::size_t width = sizeof(typename Space::Motion) / sizeof(double);
    for (std::size_t i = 0; i < k.size(); ++i)
      std::memcpy(state.memory.data() + width * i, &k[i].twist, sizeof(k[i].twist));
  });
  state.memory.tail(rate_.size()) = rate_;
  state.q += delta_;
  state.history[0].record(h, delta_);
  state.p.setZero();
  state.force_previous = forces_.total();
  state.step_previous = h;
  return report;
}

}  // namespace hamelin::integration

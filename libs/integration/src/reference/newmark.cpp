#include "newmark.hpp"

#include <cmath>

#include "finite.hpp"
#include "hamelin/core/formatted.hpp"

namespace hamelin::integration {

Newmark::Newmark(const Model& model, const NewmarkOptions& options)
    : Explicit("newmark", model, {options.isa, options.max_halvings, options.tolerance}),
      options_(options) {
  for (auto* x : {&a_, &a_new_, &q_, &v_, &displacement_}) *x = VectorXd::Zero(model.dof());
}

std::string Newmark::criterion() const {
  return formatted("h^2 |change of the acceleration|_inf <= {}", options_.tolerance);
}

// State::memory holds the accelerations of this node and of the one before.
void Newmark::begin(State& state, const ConstVectorRef& v0) {
  state.memory = VectorXd::Zero(Eigen::Index{2} * model_.dof());
  state.force_previous = VectorXd::Zero(model_.dof());
  Explicit::begin(state, v0);
}

void Newmark::update_end(const State& state, double h) {
  const double beta = options_.newmark_beta, gamma = options_.newmark_gamma;
  q_ = state.q + h * state.v + (h * h) * ((0.5 - beta) * a_ + beta * a_new_);
  v_ = state.v + h * ((1.0 - gamma) * a_ + gamma * a_new_);
}

StepReport Newmark::attempt(State& state, const Channels& channels, double h) {
  const Eigen::Index n = model_.dof();
  StepReport report;
  report.converged = false;
  // the acceleration of the last step may be reused if velocity and forces are still the same
  const bool reusable =
      !state.jumped && state.force_previous == forces_.evaluate(channels, ws_, state.q, state.v);
  if (reusable) {
    a_ = state.memory.head(n);
  } else {
    accelerate(channels, state.q, state.v, report);
    a_.swap(acceleration_);
  }
  a_new_ = a_;
  if (reusable && state.step_previous == h) a_new_ += a_ - state.memory.tail(n);
  do {
    if (report.updates == options_.max_updates) return report;
    update_end(state, h);
    accelerate(channels, q_, v_, report);
    // docs/theory.md (7.6). Eigen's norm may drop a NaN; it is then found in q_ below.
    report.residual = h * h * (acceleration_ - a_new_).lpNorm<Eigen::Infinity>();
    if (!std::isfinite(report.residual)) return report;
    a_new_.swap(acceleration_);
    ++report.updates;
  } while (report.residual > options_.tolerance);
  update_end(state, h);
  report.converged = all_finite(q_) && all_finite(v_);
  if (!report.converged) return report;
  state.memory.head(n) = a_new_;
  state.memory.tail(n) = a_;
  state.force_previous = forces_.total();
  // work by the mean of both nodes' forces; those of the new node are the last evaluated
  displacement_ = q_ - state.q;
  forces_.add_work(report, displacement_, 0.5);
  forces_.evaluate(channels, ws_, state.q, state.v);
  forces_.add_work(report, displacement_, 0.5);
  state.q.swap(q_);
  state.v.swap(v_);
  state.step_previous = h;
  return report;
}

}  // namespace hamelin::integration

#include "composition.hpp"

#include <array>
#include <utility>

namespace hamelin::integration {

namespace {

// Suzuki (1990): 1/(4 − ∛4) four times about 1 − 4/(4 − ∛4).
constexpr std::array<double, 5> order4{0.41449077179437573714, 0.41449077179437573714,
                                       -0.65796308717750294856, 0.41449077179437573714,
                                       0.41449077179437573714};
// Kahan, Li (1997), nine and seventeen sub-steps, as printed in Hairer, Lubich, Wanner, Geometric
// Numerical Integration (2006), V.3.2.
constexpr std::array<double, 9> order6{
    0.39216144400731413928,  0.33259913678935943860, -0.70624617255763935981,
    0.08221359629355080023,  0.79854399093482996340, 0.08221359629355080023,
    -0.70624617255763935981, 0.33259913678935943860, 0.39216144400731413928};
constexpr std::array<double, 17> order8{
    0.13020248308889008088,  0.56116298177510838456,  -0.38947496264484728641,
    0.15884190655515560090,  -0.39590389413323757734, 0.18453964097831570709,
    0.25837438768632204729,  0.29501172360931029887,  -0.60550853383003451170,
    0.29501172360931029887,  0.25837438768632204729,  0.18453964097831570709,
    -0.39590389413323757734, 0.15884190655515560090,  -0.38947496264484728641,
    0.56116298177510838456,  0.13020248308889008088};

}  // namespace

std::span<const double> composition_weights(int order) {
  if (order == 8) return order8;
  if (order == 6) return order6;
  return order4;
}

Composition::Composition(const Model& model, const CompositionOptions& options)
    : Momentum("composition", model, {options.isa, options.max_halvings, options.tolerance}),
      order_(options.order),
      weights_(composition_weights(order_)),
      step_(model, {.tolerance = options.tolerance, .isa = options.isa}),
      history_(weights_.size(), StepHistory(model.dof())),
      rate_(VectorXd::Zero(model.dof())) {
  inner_ = step_.start(rate_, rate_);
  step_.wrenches_ = wrenches_;  // of the step of this scheme
}

void Composition::begin(State& state, const ConstVectorRef& v0) {
  Momentum::begin(state, v0);
  state.history.assign(weights_.size(), state.history[0]);
}

StepReport Composition::attempt(State& state, const Channels& channels, double h) {
  StepReport report;
  inner_.q = state.q;
  inner_.p = state.p;
  history_ = state.history;
  for (std::size_t i = 0; i < weights_.size() && report.converged; ++i) {
    std::swap(inner_.history[0], history_[i]);
    // in the first step the guess comes from the sub-step before
    if (i > 0 && inner_.history[0].empty()) inner_.history[0].restart(rate_);
    // A sub-step is not halved alone, which would break the symmetry; the whole step is halved.
    report = merge(report, step_.attempt(inner_, channels, weights_[i] * h));
    if (i + 1 < weights_.size() && history_[i + 1].empty())
      rate_ = inner_.history[0].last() / (weights_[i] * h);
    std::swap(inner_.history[0], history_[i]);
  }
  if (!report.converged) return report;
  state.q = inner_.q;
  state.p = inner_.p;
  std::swap(state.history, history_);
  return report;
}

}  // namespace hamelin::integration

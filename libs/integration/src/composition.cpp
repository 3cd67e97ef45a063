#include "composition.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace hamelin::integration {

namespace {

constexpr std::size_t kept = 4;  // displacements that the guess of the variational step looks at

// Suzuki 1990: 1/(4 − ∛4) four times about 1 − 4/(4 − ∛4).
constexpr std::array<double, 5> order4{0.41449077179437573714, 0.41449077179437573714, -0.65796308717750294856,
                                       0.41449077179437573714, 0.41449077179437573714};
// Kahan and Li 1997, nine and seventeen stages (as in Hairer, Lubich, Wanner, Geometric Numerical Integration, V.3.2).
constexpr std::array<double, 9> order6{0.39216144400731413928,  0.33259913678935943860, -0.70624617255763935981,
                                       0.08221359629355080023,  0.79854399093482996340, 0.08221359629355080023,
                                       -0.70624617255763935981, 0.33259913678935943860, 0.39216144400731413928};
constexpr std::array<double, 17> order8{0.13020248308889008088,  0.56116298177510838456,  -0.38947496264484728641,
                                        0.15884190655515560090,  -0.39590389413323757734, 0.18453964097831570709,
                                        0.25837438768632204729,  0.29501172360931029887,  -0.60550853383003451170,
                                        0.29501172360931029887,  0.25837438768632204729,  0.18453964097831570709,
                                        -0.39590389413323757734, 0.15884190655515560090,  -0.38947496264484728641,
                                        0.56116298177510838456,  0.13020248308889008088};

// A sub-step is not halved by itself: the composition would lose its symmetry. The whole step is.
Options undivided(Options options) {
  options.max_halvings = 0;
  return options;
}

}  // namespace

std::span<const double> composition_weights(int order) {
  if (order == 8) return order8;
  if (order == 6) return order6;
  return order4;
}

Composition::Composition(const Model& model, const Options& options)
    : Momentum("composition", model, options),
      order_(options.order == 0 ? 4 : options.order),
      weights_(composition_weights(order_)),
      step_(model, undivided(options)),
      history_(kept * weights_.size(), VectorXd::Zero(model.dof())),
      last_(VectorXd::Zero(model.dof())) {
  inner_ = step_.start(last_, last_);
}

void Composition::begin(State& state, const VectorXd& v0) {
  state.deltas.assign(kept * weights_.size(), VectorXd::Zero(model_.dof()));
  set_velocity(state, v0);
}

void Composition::swap_history(std::size_t slot) {
  for (std::size_t j = 0; j < kept; ++j) inner_.deltas[j].swap(history_[kept * slot + j]);
}

StepReport Composition::attempt(State& state, const Channels& channels, double h) {
  StepReport report;
  inner_.q = state.q;
  inner_.v = state.v;
  inner_.p = state.p;
  history_ = state.deltas;
  for (std::size_t i = 0; i < weights_.size() && report.converged; ++i) {
    swap_history(i);
    inner_.delta_count = state.delta_count;
    inner_.step_previous = weights_[i] * state.step_previous;
    if (state.delta_count <= 0 && i > 0) {  // no step before: the sub-step before will do
      inner_.delta_count = 1;
      inner_.deltas[0] = last_;
      inner_.step_previous = weights_[i - 1] * h;
    }
    report = together(report, step_.advance(inner_, channels, weights_[i] * h));
    last_ = inner_.deltas[0];
    swap_history(i);
  }
  if (!report.converged) return report;
  state.q = inner_.q;
  state.p = inner_.p;
  std::swap(state.deltas, history_);
  state.delta_count = state.delta_count > 0 && state.step_previous == h ? std::min(state.delta_count + 1, 4) : 1;
  state.step_previous = h;
  return report;
}

}  // namespace hamelin::integration

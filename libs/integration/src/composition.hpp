#pragma once
#include <span>

#include "momentum.hpp"
#include "variational.hpp"

namespace hamelin::integration {

/// Weights γ_i of a symmetric composition of sub-steps γ_i h: Σ γ_i = 1, γ_i = γ_{s+1−i}; order 4, 6 or 8.
[[nodiscard]] std::span<const double> composition_weights(int order);

/// Symmetric compositions of the variational step: Φ_h = φ_{γ_s h} ∘ … ∘ φ_{γ_1 h}. As φ is symmetric and symplectic,
/// so is Φ. Some γ_i are negative: such a sub-step goes back in time, its damping feeds energy in and is booked so.
class Composition final : public Momentum {
 public:
  Composition(const Model& model, const CompositionOptions& options);
  [[nodiscard]] std::string criterion() const override { return step_.criterion(); }
  [[nodiscard]] int order() const override { return order_; }
  [[nodiscard]] std::string mode() const override { return step_.mode(); }

 private:
  void begin(State& state, const ConstVectorRef& v0) override;
  StepReport attempt(State& state, const Channels& channels, double h) override;

  int order_;
  std::span<const double> weights_;
  Variational step_;
  State inner_;                       ///< what the sub-steps move
  std::vector<StepHistory> history_;  ///< State::history as a step changes it
  VectorXd rate_;                     ///< mean velocity of the sub-step before
};

}  // namespace hamelin::integration

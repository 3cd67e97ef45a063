#pragma once
#include <span>

#include "momentum.hpp"
#include "schemes/variational.hpp"

namespace hamelin::integration {

/// Weights γ_i of a symmetric composition of sub-steps γ_i h, docs/theory.md (5.16).
/// @param order 4, 6 or 8
[[nodiscard]] std::span<const double> composition_weights(int order);

/// Symmetric compositions of the variational step φ, docs/theory.md (5.16): Φ_h = φ_{γ_s h} ∘ … ∘
/// φ_{γ_1 h}. φ is symmetric and symplectic, so Φ is too. Some γ_i are negative, docs/theory.md
/// (5.18): in such a sub-step damping feeds energy in, and its work is booked with that sign.
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
  State inner_;                       ///< the state of the sub-steps
  std::vector<StepHistory> history_;  ///< State::history during a step
  VectorXd rate_;                     ///< mean velocity of the sub-step before
};

}  // namespace hamelin::integration

#pragma once
#include "explicit.hpp"

namespace hamelin::integration {

/// Newmark's scheme (1959) on (q, v, a): with a⁺ the acceleration at the new node,
///   q⁺ = q + h v + h² ((½ − β) a + β a⁺),   v⁺ = v + h ((1 − γ) a + γ a⁺),   a⁺ = forward dynamics at (q⁺, v⁺),
/// the last solved by iterating it. β = ¼, γ = ½ (average acceleration) is of order 2; γ > ½ damps and is of order 1.
class Newmark final : public Explicit {
 public:
  Newmark(const Model& model, const NewmarkOptions& options);
  [[nodiscard]] std::string criterion() const override;
  [[nodiscard]] int order() const override { return options_.newmark_gamma == 0.5 ? 2 : 1; }

 private:
  void begin(State& state, const ConstVectorRef& v0) override;
  StepReport attempt(State& state, const Channels& channels, double h) override;
  /// q_, v_ from the accelerations at both nodes.
  void place(const State& state, double h);

  const NewmarkOptions options_;
  VectorXd a_, a_new_, q_, v_, moved_;
};

}  // namespace hamelin::integration

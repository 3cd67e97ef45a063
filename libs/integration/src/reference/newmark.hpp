#pragma once
#include "explicit.hpp"

namespace hamelin::integration {

/// Newmark's scheme (1959), docs/theory.md (7.5), with the acceleration a⁺ at the new node from the
/// iteration (7.6):
///   q⁺ = q + h v + h² ((½ − β) a + β a⁺),   v⁺ = v + h ((1 − γ) a + γ a⁺),   a⁺ = a(q⁺, v⁺).
/// β = ¼, γ = ½ (average acceleration) has order 2; γ > ½ damps and has order 1.
class Newmark final : public Explicit {
 public:
  Newmark(const Model& model, const NewmarkOptions& options);
  [[nodiscard]] std::string criterion() const override;
  [[nodiscard]] int order() const override { return options_.newmark_gamma == 0.5 ? 2 : 1; }

 private:
  void begin(State& state, const ConstVectorRef& v0) override;
  StepReport attempt(State& state, const Channels& channels, double h) override;
  /// q_, v_ at the new node from the accelerations at both nodes.
  void update_end(const State& state, double h);

  const NewmarkOptions options_;
  VectorXd a_, a_new_, q_, v_, displacement_;
};

}  // namespace hamelin::integration

#pragma once
#include <vector>

#include "kernel/gauss.hpp"
#include "momentum.hpp"

namespace hamelin::integration {

/// Gauss–Legendre collocation in (θ, p), order 4 … 16 by order/2 stages: the Galerkin variational integrator of that
/// degree, symplectic and symmetric. A stage is v = M⁻¹p, ṗ_i = λ_i·ad(X_i)A_i − ∂_iU + F_i; all stages of a
/// sweep go through SIMD lanes together (kernel/gauss.hpp). Fixed steps iterated to rounding keep the structure; with
/// rtol or atol the step follows an error estimate made of what the first sweep changed.
class GaussLegendre final : public Momentum {
 public:
  GaussLegendre(const Model& model, const GaussOptions& options);
  [[nodiscard]] std::string criterion() const override;
  [[nodiscard]] int order() const override { return static_cast<int>(2 * tableau_.stages); }
  [[nodiscard]] std::string mode() const override;

 private:
  void begin(State& state, const ConstVectorRef& v0) override;
  StepReport attempt(State& state, const Channels& channels, double h) override;
  StepReport controlled(State& state, const Channels& channels, double limit) override;
  /// Fixed steps iterated to rounding.
  [[nodiscard]] bool structure() const noexcept { return !adaptive() && settings_.tolerance <= 1e-12; }
  /// One solve from the state into q_next_, p_next_, slopes_; the state stays.
  kernel::GaussOutcome solve(const State& state, const Channels& channels, double h, double tolerance,
                             StepReport& report);
  void accept(State& state, const kernel::GaussOutcome& outcome, double h, StepReport& report);

  kernel::GaussTableau tableau_;
  const kernel::GaussSet* kernels_;
  dynamics::AlignedBuffer memory_;
  std::vector<dynamics::kernel::Spin> spins_;
  VectorXd q_next_, p_next_, slopes_;
  State ahead_;  ///< the first step's end, until a second has judged it
};

}  // namespace hamelin::integration

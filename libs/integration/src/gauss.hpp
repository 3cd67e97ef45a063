#pragma once
#include <vector>

#include "kernel/gauss.hpp"
#include "momentum.hpp"

namespace hamelin::integration {

/// Gauss–Legendre collocation in (θ, p), docs/theory.md (5.1): order 4 to 16 with order/2 stages,
/// symplectic and symmetric. All stages of a sweep go through SIMD lanes together
/// (kernel/gauss.hpp). Fixed steps iterated to rounding keep the structure; with rtol or atol the
/// step length follows an error estimate from the change in the first sweep, docs/theory.md (5.9).
class GaussLegendre final : public Momentum {
 public:
  GaussLegendre(const Model& model, const GaussOptions& options);
  [[nodiscard]] std::string criterion() const override;
  [[nodiscard]] int order() const override { return static_cast<int>(2 * tableau_.stages); }
  [[nodiscard]] std::string mode() const override;

 private:
  void begin(State& state, const ConstVectorRef& v0) override;
  StepReport attempt(State& state, const Channels& channels, double h) override;
  StepReport controlled_step(State& state, const Channels& channels, double limit) override;
  /// Fixed steps iterated to rounding.
  [[nodiscard]] bool structure() const noexcept {
    return !adaptive() && settings_.tolerance <= 1e-12;
  }
  /// Solves a step from the state into q_next_, p_next_ and slopes_; the state is unchanged.
  kernel::GaussOutcome solve(const State& state, const Channels& channels, double h,
                             double tolerance, StepReport& report);
  void accept(State& state, const kernel::GaussOutcome& outcome, double h, StepReport& report);

  kernel::GaussTableau tableau_;
  const kernel::GaussSet* kernels_;
  dynamics::AlignedBuffer memory_;
  std::vector<dynamics::kernel::Spin> spins_;
  VectorXd q_next_, p_next_, slopes_;
  State ahead_;  ///< the end of a first step until a second step has estimated its error
};

}  // namespace hamelin::integration

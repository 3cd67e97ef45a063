#pragma once
#include <vector>

#include "hamelin/integration/integrator.hpp"
#include "kernel/gauss.hpp"

namespace hamelin::integration {

/// Gauss–Legendre collocation of order 4 to 16 with order/2 stages. All stages of a sweep go
/// through SIMD lanes together (kernel/gauss.hpp). Fixed steps iterated to rounding step (q, p) by
/// docs/theory.md (5.4), which is symplectic and symmetric. Otherwise (q, v) is stepped by
/// docs/theory.md (5.6), which takes fewer sweeps; with rtol or atol the step length follows an
/// error estimate from the change in the first sweep, docs/theory.md (5.14).
class GaussLegendre final : public Integrator {
 public:
  GaussLegendre(const Model& model, const GaussOptions& options);
  [[nodiscard]] std::string criterion() const override;
  [[nodiscard]] int order() const override { return static_cast<int>(2 * tableau_.stages); }
  [[nodiscard]] std::string mode() const override;

 private:
  void begin(State& state, const ConstVectorRef& v0) override;
  void node_velocity(const State& state, VectorRef v) const override;
  void add_momentum(State& state, const ConstVectorRef& dp) override;
  void replace_velocity(State& state, const ConstVectorRef& v) override;
  StepReport attempt(State& state, const Channels& channels, double h) override;
  StepReport controlled_step(State& state, const Channels& channels, double limit) override;
  [[nodiscard]] kernel::GaussForm form() const noexcept {
    return structure_ ? kernel::GaussForm::momentum : kernel::GaussForm::velocity;
  }
  [[nodiscard]] kernel::GaussMemory memory(VectorXd& numbers) const;
  const kernel::GaussGuess& guess_for(double ratio, double older_at);
  /// The part of the state that is stepped beside q.
  [[nodiscard]] VectorXd& rate_part(State& state) const noexcept {
    return structure_ ? state.p : state.v;
  }
  [[nodiscard]] const VectorXd& rate_part(const State& state) const noexcept {
    return structure_ ? state.p : state.v;
  }
  /// Solves a step from the state into q_next_, u_next_ and memory_next_; the state is unchanged.
  kernel::GaussOutcome solve(const State& state, const Channels& channels, double h,
                             double tolerance, StepReport& report);
  void accept(State& state, const kernel::GaussOutcome& outcome, double h, StepReport& report);

  const bool structure_;  ///< fixed steps iterated to rounding
  kernel::GaussTableau tableau_;
  kernel::GaussGuess guess_{};  ///< for these two numbers
  double guess_ratio_ = 0.0, guess_older_at_ = 0.0;
  const kernel::GaussSet* kernels_;
  dynamics::AlignedBuffer scratch_;
  std::vector<dynamics::kernel::Spin> spins_;
  VectorXd q_next_, u_next_, memory_next_;
  State ahead_;  ///< the end of a first step until a second step has estimated its error
};

}  // namespace hamelin::integration

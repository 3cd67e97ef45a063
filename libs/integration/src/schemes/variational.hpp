#pragma once
#include <vector>

#include "kernel/variational.hpp"
#include "momentum.hpp"

namespace hamelin::integration {

/// hamel-variational: the exact variation of the discrete Lagrangian
///   L_d = h [K(θ_mid, Δ/h) − ½ U(θ^k) − ½ U(θ^{k+1})],
/// docs/theory.md (4.1), solved for Δ by an exact Newton step in O(n) (kernel/variational.hpp) or
/// by the feedback (4.29).
class Variational final : public Momentum {
 public:
  Variational(const Model& model, const VariationalOptions& options);
  [[nodiscard]] std::string criterion() const override;
  [[nodiscard]] int order() const override { return 2; }
  [[nodiscard]] std::string mode() const override;

 private:
  friend class Composition;  // calls attempt() with negative steps
  StepReport attempt(State& state, const Channels& channels, double h) override;
  /// ∂U(q), reused from the last call if that was for the same q.
  const VectorXd& gradient(const VectorXd& q);
  /// f(entry, call) for the kernel of this model.
  template <class F>
  kernel::VariationalOutcome with_call(const State& state, double h, F&& f);
  kernel::VariationalOutcome solve_newton(const State& state, double h);
  kernel::VariationalOutcome solve_feedback(const State& state, double h);
  /// Whether steps may be accepted without the confirming sweep, docs/theory.md (4.28).
  [[nodiscard]] bool accepts_unconfirmed() const noexcept;

  using Solver = VariationalOptions::Solver;

  const VariationalOptions options_;
  const kernel::VariationalSet* kernels_;
  dynamics::AlignedBuffer memory_;
  std::vector<dynamics::kernel::Spin> spins_;
  kernel::Forces forces_{};  ///< of the current step
  VectorXd delta_, p_, p_next_, correction_, residual_;
  VectorXd gradient_, gradient_at_;
};

}  // namespace hamelin::integration

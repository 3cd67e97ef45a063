#pragma once
#include <vector>

#include "kernel/variational.hpp"
#include "momentum.hpp"

namespace hamelin::integration {

/// hamel-variational: the exact variation of L_d = h [T(θ_mid, Δ/h) − ½U(θ^k) − ½U(θ^{k+1})], solved for Δ by
/// the exact O(n) Newton step (kernel/variational.hpp) or by the paper's feedback (16).
class Variational final : public Momentum {
 public:
  Variational(const Model& model, const VariationalOptions& options);
  [[nodiscard]] std::string criterion() const override;
  [[nodiscard]] int order() const override { return 2; }
  [[nodiscard]] std::string mode() const override;

 private:
  friend class Composition;  // whose sub-steps may go back in time
  StepReport attempt(State& state, const Channels& channels, double h) override;
  /// ∂U(q), kept from the last call where that was for the same q.
  const VectorXd& gradient(const VectorXd& q);
  /// f(entry, call) for the kernel of this model.
  template <class F>
  kernel::VariationalOutcome with_call(const State& state, double h, F&& f);
  kernel::VariationalOutcome solve_newton(const State& state, double h);
  kernel::VariationalOutcome solve_feedback(const State& state, double h);
  [[nodiscard]] bool trusts_quadratic() const noexcept;

  using Solver = VariationalOptions::Solver;

  const VariationalOptions options_;
  const kernel::VariationalSet* kernels_;
  dynamics::AlignedBuffer memory_;
  std::vector<dynamics::kernel::Spin> spins_;
  kernel::Forces forces_{};  ///< of the step under way
  VectorXd delta_, p_, p_next_, correction_, residual_;
  VectorXd gradient_, gradient_at_;
};

}  // namespace hamelin::integration

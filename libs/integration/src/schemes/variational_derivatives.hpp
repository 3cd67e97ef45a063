#pragma once
#include "channels/force_derivatives.hpp"
#include "hamelin/dynamics/derivatives.hpp"
#include "hamelin/integration/step_derivatives.hpp"
#include "linear_system.hpp"

namespace hamelin::integration {

/// Differentiates steps of hamel-variational, docs/theory.md (4.31)–(4.33).
class VariationalDifferentiator final : public StepDifferentiator {
 public:
  VariationalDifferentiator(const Model& model, const VariationalOptions& options);

 private:
  [[nodiscard]] double last_step(const State& after) const override;
  [[nodiscard]] bool compute(const State& after, const Channels& channels,
                             StepDerivatives& out) override;
  void assemble(double h);
  void write(double h, StepDerivatives& out);

  dynamics::DerivativesWorkspace ws_;
  dynamics::KineticDerivatives kinetic_;             ///< at the midpoint
  dynamics::PotentialDerivatives potential_, next_;  ///< at q and at q⁺
  ForceDerivatives forces_;                          ///< at the midpoint
  LinearSystem system_;
  Eigen::MatrixXd curvature_;                ///< ∂²K/∂q² + ∂F/∂q
  RowMatrixXd minus_p_by_delta_, p_by_all_;  ///< −∂p⁺/∂Δ; the derivatives of p⁺ by (q, p, h)
  VectorXd q_, v_;
};

}  // namespace hamelin::integration

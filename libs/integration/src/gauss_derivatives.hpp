#pragma once
#include <vector>

#include "force_derivatives.hpp"
#include "hamelin/dynamics/derivatives.hpp"
#include "hamelin/integration/step_derivatives.hpp"
#include "kernel/gauss.hpp"
#include "linear_system.hpp"

namespace hamelin::integration {

/// Differentiates steps of gauss in the form (5.4), docs/theory.md (5.19)–(5.22).
class GaussDifferentiator final : public StepDifferentiator {
 public:
  GaussDifferentiator(const Model& model, const GaussOptions& options);

 private:
  /// The derivatives of the forces on p at a stage, and the stage's rates.
  struct Stage {
    explicit Stage(Eigen::Index dof);
    Eigen::MatrixXd M, dp_dq;  ///< of p(q, v)
    Eigen::MatrixXd by_q;      ///< E: ∂(∂K/∂q − ∂U/∂q + F)/∂q
    Eigen::MatrixXd by_v;      ///< D
    VectorXd v, p_rate;
    VectorXd v_sum;  ///< Σ_j a_ij v_j
  };

  [[nodiscard]] double last_step(const State& after) const override;
  [[nodiscard]] bool compute(const State& after, const Channels& channels,
                             StepDerivatives& out) override;
  void evaluate(const State& after, const Channels& channels, double h);
  void assemble(double h);
  void write(double h, StepDerivatives& out);
  [[nodiscard]] double a(Eigen::Index i, Eigen::Index j) const {
    return tableau_.mu_column[j][i] * tableau_.b[j];
  }
  [[nodiscard]] auto weighed(Eigen::Index row) const {
    return Eigen::Map<const Eigen::MatrixXd>(weighed_.row(row).data(), model_.dof(), model_.dof());
  }

  kernel::GaussTableau tableau_;
  Eigen::Index stages_;
  dynamics::DerivativesWorkspace ws_;
  dynamics::KineticDerivatives kinetic_;
  dynamics::PotentialDerivatives potential_;
  ForceDerivatives forces_;
  std::vector<Stage> stage_;
  LinearSystem system_;
  RowMatrixXd weights_, by_q_, weighed_;  ///< sums of E over the stages, docs/theory.md (5.20)
  RowMatrixXd p_by_v_, q_by_all_, p_by_all_;
  VectorXd q_, memory_;
};

}  // namespace hamelin::integration

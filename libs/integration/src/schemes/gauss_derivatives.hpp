#pragma once
#include <array>
#include <vector>

#include "channels/force_derivatives.hpp"
#include "hamelin/dynamics/derivatives.hpp"
#include "hamelin/integration/step_derivatives.hpp"
#include "kernel/gauss.hpp"
#include "linear_system.hpp"

namespace hamelin::integration {

/// Differentiates steps of gauss in the form (5.4), docs/theory.md (5.19)–(5.23).
class GaussDifferentiator final : public StepDifferentiator {
 public:
  GaussDifferentiator(const Model& model, const GaussOptions& options);

 private:
  /// The derivatives of the forces on p at a stage, and the stage's rates. Matrices are n × n with
  /// rows of zeros up to padded(n).
  struct Stage {
    explicit Stage(Eigen::Index dof);
    Eigen::MatrixXd M, dp_dq;  ///< of p(q, v)
    Eigen::MatrixXd by_q;      ///< E: ∂(∂K/∂q − ∂U/∂q + F)/∂q
    Eigen::MatrixXd by_v;      ///< D
    VectorXd v;
    VectorXd v_sum;   ///< w = Σ_j a_ij v_j
    VectorXd p_rate;  ///< ṗ + h E w
  };
  /// A weighted sum of matrices.
  struct Sum {
    Sum& add(double weight, const double* matrix);
    std::size_t count = 0;
    std::array<const double*, kernel::max_stages + 3> terms;
    std::array<double, kernel::max_stages + 3> weights;
  };

  [[nodiscard]] double last_step(const State& after) const override;
  [[nodiscard]] bool compute(const State& after, const Channels& channels,
                             StepDerivatives& out) override;
  void evaluate(const State& after, const Channels& channels, double h);
  void assemble(double h);
  void assemble_right(double h);
  void combine_solution(double h);
  void write(double h, StepDerivatives& out) const;
  /// Writes a sum of n columns of `size` numbers each.
  void store(const Sum& sum, Eigen::Index term_stride, Eigen::Index size, double* out,
             Eigen::Index out_stride) const;
  [[nodiscard]] double a(Eigen::Index i, Eigen::Index j) const {
    return tableau_.mu_column[j][i] * tableau_.b[j];
  }

  kernel::GaussTableau tableau_;
  Eigen::Index stages_;
  dynamics::DerivativesWorkspace ws_;
  dynamics::KineticDerivatives kinetic_;
  dynamics::PotentialDerivatives potential_;
  ForceDerivatives forces_;
  std::vector<Stage> stage_;
  LinearSystem system_;      ///< of Y in (5.23), transposed
  RowMatrixXd minus_right_;  ///< minus the factors of δq and δh in (5.21); a row per column
  RowMatrixXd by_start_;     ///< derivatives of (q⁺, p⁺) by q and h, transposed
  RowMatrixXd by_momentum_, by_torque_;  ///< the same by p and u, without the terms outside of Y
  VectorXd q_, memory_;
};

}  // namespace hamelin::integration

#pragma once
#include <Eigen/LU>
#include <array>

#include "channels/force_derivatives.hpp"
#include "explicit.hpp"
#include "hamelin/dynamics/derivatives.hpp"
#include "step_controller.hpp"

namespace hamelin::integration {

/// RODAS of Hairer, Wanner (Solving Ordinary Differential Equations II, 2nd edition, 1996, IV.7,
/// code rodas.f), docs/theory.md (7.12): a stiffly accurate Rosenbrock method of order 4 with six
/// stages and an embedded one of order 3, for stiff forces and as a reference. Always under step
/// control, with rtol = atol = 1e-10 unless set. The Jacobian is exact except for wrench laws, and
/// made once per step; as q̇ = v, the linear systems have size dof only.
class Rosenbrock final : public Explicit {
 public:
  Rosenbrock(const Model& model, const RosenbrockOptions& options);
  [[nodiscard]] std::string criterion() const override;
  [[nodiscard]] int order() const override { return 4; }

 private:
  Rosenbrock(const RosenbrockOptions& options, const Model& model);

  static constexpr std::size_t stages = 6;
  /// Work of gyroscopic terms, dissipated work, work of held torques; integrated along with the
  /// motion.
  using Works = Eigen::Vector4d;

  StepReport attempt(State& state, const Channels& channels, double h) override;
  StepReport controlled_step(State& state, const Channels& channels, double limit) override;
  /// acceleration_ and the channels' powers at (q, v).
  Works derivative(const Channels& channels, const VectorXd& q, const VectorXd& v,
                   StepReport& report);
  void make_jacobian(const State& state, const Channels& channels, StepReport& report);
  /// A step of length h from the state to q_, v_, works_; the last stage is the error estimate.
  void try_step(const State& state, const Channels& channels, double h, StepReport& report);
  void solve_stage(std::size_t stage, const Channels& channels, double h, StepReport& report);
  [[nodiscard]] double error_norm(const State& state) const;

  dynamics::DerivativesWorkspace derivatives_;
  ForceDerivatives forces_by_;
  /// ∂a/∂q, ∂a/∂v, M⁻¹, the matrix that is factored
  Eigen::MatrixXd by_q_, by_v_, inverse_mass_, matrix_;
  Eigen::Matrix4Xd works_by_q_, works_by_v_;  ///< ∂powers/∂(q, v)
  Eigen::PartialPivLU<Eigen::MatrixXd> factors_;
  std::array<VectorXd, stages> dq_, dv_;  ///< the stages' increments
  std::array<Works, stages> dworks_;
  VectorXd q_, v_, right_q_, right_v_;
  Works works_;
};

}  // namespace hamelin::integration

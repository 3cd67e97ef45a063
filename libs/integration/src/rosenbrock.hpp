#pragma once
#include <Eigen/LU>
#include <array>

#include "explicit.hpp"
#include "step_controller.hpp"

namespace hamelin::integration {

/// RODAS of Hairer and Wanner (Solving Ordinary Differential Equations II, 2nd ed., IV.7, code rodas.f): a stiffly
/// accurate Rosenbrock method of order 4 with six stages and an embedded one of order 3. It is there for stiff forces
/// and to judge others by. Always under step control, rtol = atol = 1e-10 unless told else. The Jacobian is dense, by
/// central differences of forward dynamics, made once a step; as q̇ = v, the linear systems are of size dof only.
class Rosenbrock final : public Explicit {
 public:
  Rosenbrock(const Model& model, const RosenbrockOptions& options);
  [[nodiscard]] std::string criterion() const override;
  [[nodiscard]] int order() const override { return 4; }

 private:
  Rosenbrock(const RosenbrockOptions& options, const Model& model);

  static constexpr std::size_t stages = 6;
  using Works = Eigen::Vector3d;  ///< of gyroscopic terms, dissipated, of held torques: they come along with the motion

  StepReport attempt(State& state, const Channels& channels, double h) override;
  StepReport controlled(State& state, const Channels& channels, double limit) override;
  /// acceleration_ and the channels' powers at (q, v).
  Works derivative(const Channels& channels, const VectorXd& q, const VectorXd& v, StepReport& report);
  void make_jacobian(const State& state, const Channels& channels, StepReport& report);
  /// From the state over h to q_, v_, works_, with the error in the last stage.
  void try_step(const State& state, const Channels& channels, double h, StepReport& report);
  void solve_stage(std::size_t stage, const Channels& channels, double h, StepReport& report);
  [[nodiscard]] double error_norm(const State& state) const;

  Eigen::MatrixXd by_q_, by_v_, matrix_;      ///< ∂a/∂q, ∂a/∂v, what is factored
  Eigen::Matrix3Xd works_by_q_, works_by_v_;  ///< ∂powers/∂(q, v)
  Eigen::PartialPivLU<Eigen::MatrixXd> factors_;
  std::array<VectorXd, stages> dq_, dv_;  ///< the stages' increments
  std::array<Works, stages> dworks_;
  VectorXd q_, v_, right_q_, right_v_, up_;
  Works works_;
};

}  // namespace hamelin::integration

#pragma once
#include <Eigen/Core>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"

/// Exact first derivatives of inverse and forward dynamics, in O(n²): docs/theory.md (2.24)–(2.29).
namespace hamelin::dynamics {

using MatrixRef = Eigen::Ref<Eigen::MatrixXd>;

/// Scratch memory of one thread for derivatives; as Workspace, for one model or its copies.
class DerivativesWorkspace {
 public:
  /// @throws Error usage if this machine does not have the instruction set
  explicit DerivativesWorkspace(const model::Model& model, Isa isa = default_isa());
  /// Deleted: a temporary model is gone before any call could use the workspace.
  explicit DerivativesWorkspace(const model::Model&& model, Isa isa = default_isa()) = delete;

  /// A motion (angular velocity, and velocity at the reference point), or a wrench (moment about
  /// the reference point, and force); world axes. The reference point is the base's origin.
  struct Pair {
    Eigen::Vector3d angular, linear;
  };
  /// Sums over a link and all links outboard.
  struct Composite {
    double mass;
    Eigen::Vector3d moment;    ///< Σ m r
    Eigen::Matrix3d second;    ///< Σ m r rᵀ
    Eigen::Vector3d momentum;  ///< Σ m ṙ
    Eigen::Matrix3d flow;      ///< Σ m ṙ rᵀ
    Pair wrench;               ///< that moves them
  };
  /// The screw of a joint, and its first and second derivative with the parent's motion, (2.25).
  struct Axis {
    Pair screw, first, second;
  };

  Workspace ws;
  std::vector<Axis> axes;
  std::vector<Composite> links;
  Eigen::MatrixXd mass, dq, dv;  ///< of forward_dynamics_derivatives
  Eigen::VectorXd acceleration;
};

/// ∂τ/∂q, ∂τ/∂v and ∂τ/∂a = M(q) of inverse dynamics at (q, v, a): n × n each, row i the torque of
/// joint i. The columns of ∂τ/∂q are torques per radian or metre.
/// @throws Error usage for sizes or a workspace that do not fit the model
void inverse_dynamics_derivatives(const Model& model, DerivativesWorkspace& ws,
                                  const ConstVectorRef& q, const ConstVectorRef& v,
                                  const ConstVectorRef& a, MatrixRef dtau_dq, MatrixRef dtau_dv,
                                  MatrixRef dtau_da);

/// ∂a/∂q, ∂a/∂v and ∂a/∂τ = M(q)⁻¹ of forward dynamics at (q, v, τ): n × n each, row i the
/// acceleration of joint i; and a itself.
/// @throws Error usage for sizes or a workspace that do not fit the model
void forward_dynamics_derivatives(const Model& model, DerivativesWorkspace& ws,
                                  const ConstVectorRef& q, const ConstVectorRef& v,
                                  const ConstVectorRef& tau, VectorRef a, MatrixRef da_dq,
                                  MatrixRef da_dv, MatrixRef da_dtau);

}  // namespace hamelin::dynamics

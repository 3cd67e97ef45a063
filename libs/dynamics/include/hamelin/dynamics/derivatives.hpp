#pragma once
#include <Eigen/Core>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"

/// Exact derivatives in O(n²), docs/theory.md (2.24)–(2.32): the first ones of inverse and forward
/// dynamics, and the first and second ones of the energies. Results may share memory with arguments
/// in any way, as for the functions of dynamics.hpp.
namespace hamelin::dynamics {

using MatrixRef = Eigen::Ref<Eigen::MatrixXd>;

struct DerivativeKernels;
namespace kernel {
struct DerivativeLink;
struct DerivativeFrame;
}  // namespace kernel

/// Scratch memory of one thread for derivatives; as Workspace, for one model or its copies.
class DerivativesWorkspace {
 public:
  /// @throws Error usage as Workspace
  explicit DerivativesWorkspace(const model::Model& model, Isa isa = default_isa());
  /// Deleted: a temporary model is gone before any call could use the workspace.
  explicit DerivativesWorkspace(const model::Model&& model, Isa isa = default_isa()) = delete;
  ~DerivativesWorkspace();
  DerivativesWorkspace(const DerivativesWorkspace&) = delete;
  DerivativesWorkspace& operator=(const DerivativesWorkspace&) = delete;

  Workspace ws;
  const DerivativeKernels* kernels;
  AlignedBuffer sweep;       ///< scratch of the kernels
  AlignedBuffer matrices;    ///< five, with the kernels' leading dimension
  Eigen::MatrixXd external;  ///< derivative of the torques of external wrenches
  std::vector<kernel::DerivativeLink> links;
  std::vector<kernel::DerivativeFrame> frames;
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

/// Derivatives of the kinetic energy K(q, v) = ½ vᵀM(q)v, docs/theory.md (2.31). Matrices are n ×
/// n.
struct KineticDerivatives {
  explicit KineticDerivatives(Eigen::Index dof);
  VectorXd p;             ///< momenta ∂K/∂v = M(q) v
  VectorXd dK_dq;         ///< ∂K/∂q at constant v
  Eigen::MatrixXd M;      ///< ∂²K/∂v²
  Eigen::MatrixXd dp_dq;  ///< ∂²K/∂v∂q: row i the momentum of joint i
  Eigen::MatrixXd d2K_dq2;
};
/// Derivatives of the potential energy U(q), docs/theory.md (2.32).
struct PotentialDerivatives {
  explicit PotentialDerivatives(Eigen::Index dof);
  VectorXd dU_dq;
  Eigen::MatrixXd d2U_dq2;
};

/// @param out made for as many joints
/// @throws Error usage for sizes or a workspace that do not fit the model
void kinetic_derivatives(const Model& model, DerivativesWorkspace& ws, const ConstVectorRef& q,
                         const ConstVectorRef& v, KineticDerivatives& out);
/// The same for the potential energy.
void potential_derivatives(const Model& model, DerivativesWorkspace& ws, const ConstVectorRef& q,
                           PotentialDerivatives& out);
/// Both at one q, cheaper than two calls.
void energy_derivatives(const Model& model, DerivativesWorkspace& ws, const ConstVectorRef& q,
                        const ConstVectorRef& v, KineticDerivatives& kinetic,
                        PotentialDerivatives& potential);

}  // namespace hamelin::dynamics

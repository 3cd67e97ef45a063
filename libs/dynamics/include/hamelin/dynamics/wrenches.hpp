#pragma once
#include <span>

#include "hamelin/dynamics/derivatives.hpp"
#include "hamelin/dynamics/frames.hpp"

/// External wrenches on frames, docs/theory.md (2.37)–(2.39).
namespace hamelin::dynamics {

/// A wrench that the surroundings exert on the link of a frame: [moment; force] in the terms of a
/// reference, so that its product with the frame's twist of that reference is its power. `world`:
/// the moment is about the world's origin. `local`: it turns with the link. On a frame of the base
/// it does nothing.
struct ExternalWrench {
  int frame = Model::tip_frame;  ///< an index into Model::frames()
  Reference reference = Reference::local_world_aligned;
  Vector6d wrench = Vector6d::Zero();  ///< [Nm; N]
};

/// The same wrench in world axes, about the frame's origin: docs/theory.md (2.38).
/// @param pose of the frame in the world
[[nodiscard]] Vector6d aligned_wrench(const ExternalWrench& wrench, const geometry::SE3& pose);

/// Joint torques Σ Jᵀ F of wrenches, O(n + wrenches). Overwrites the poses in ws with those at q.
/// @throws Error usage for sizes, a frame that does not exist, or a workspace of another model
void external_torque(const Model& model, Workspace& ws, const ConstVectorRef& q,
                     std::span<const ExternalWrench> wrenches, VectorRef tau);
/// The same at the poses in ws, after forward_kinematics.
void external_torque(const Model& model, Workspace& ws, std::span<const ExternalWrench> wrenches,
                     VectorRef tau);

/// ∂(Σ Jᵀ F)/∂q at constant F, n × n, row i the torque of joint i, O(n² wrenches). Overwrites the
/// poses in ws.
/// @throws as external_torque
void external_torque_derivative(const Model& model, Workspace& ws, const ConstVectorRef& q,
                                std::span<const ExternalWrench> wrenches, MatrixRef dtau_dq);

/// τ = M a + C v + ∂U − Σ Jᵀ F: what the joints exert while the wrenches act.
/// @throws as external_torque
void inverse_dynamics(const Model& model, Workspace& ws, const ConstVectorRef& q,
                      const ConstVectorRef& v, const ConstVectorRef& a,
                      std::span<const ExternalWrench> wrenches, VectorRef tau);

/// a = M⁻¹(τ + Σ Jᵀ F − C v − ∂U).
/// @throws as external_torque
void forward_dynamics(const Model& model, Workspace& ws, const ConstVectorRef& q,
                      const ConstVectorRef& v, const ConstVectorRef& tau,
                      std::span<const ExternalWrench> wrenches, VectorRef a);

/// As the functions of derivatives.hpp, at constant wrenches.
/// @throws as external_torque
void inverse_dynamics_derivatives(const Model& model, DerivativesWorkspace& ws,
                                  const ConstVectorRef& q, const ConstVectorRef& v,
                                  const ConstVectorRef& a, std::span<const ExternalWrench> wrenches,
                                  MatrixRef dtau_dq, MatrixRef dtau_dv, MatrixRef dtau_da);
void forward_dynamics_derivatives(const Model& model, DerivativesWorkspace& ws,
                                  const ConstVectorRef& q, const ConstVectorRef& v,
                                  const ConstVectorRef& tau,
                                  std::span<const ExternalWrench> wrenches, VectorRef a,
                                  MatrixRef da_dq, MatrixRef da_dv, MatrixRef da_dtau);

}  // namespace hamelin::dynamics

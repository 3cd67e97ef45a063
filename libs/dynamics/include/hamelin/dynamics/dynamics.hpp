#pragma once
#include <Eigen/Core>
#include <span>

#include "hamelin/dynamics/vector_ref.hpp"
#include "hamelin/dynamics/workspace.hpp"
#include "hamelin/model/model.hpp"

/// Recursive algorithms on an open chain, O(n) but for the mass matrix. `Model` is const and shared, `Workspace` holds
/// all scratch of one thread; nothing here allocates. Joint vectors have one number per joint (dof); velocity,
/// acceleration and torque pair as watts. Equations as in the README of this library.
///
/// Every call checks the sizes of its arguments, and that the workspace was made for this model, and throws an Error
/// (usage) that names function, argument, what was given and what was expected. Results are written where they are
/// asked for and never resized. Whether numbers are finite is not checked: what is not finite comes out not finite.
namespace hamelin::dynamics {

using Eigen::VectorXd;
using model::Model;
using Matrix3Xd = Eigen::Matrix<double, 3, Eigen::Dynamic>;
using Matrix6Xd = Eigen::Matrix<double, 6, Eigen::Dynamic>;
/// Joint vectors of many states, dof × states: the states' numbers for one joint stand side by side.
using StatesXd = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using ConstStatesRef = ConstRef<StatesXd>;
using StatesRef = Eigen::Ref<StatesXd>;

/// τ = M(q) a + C(q, v) v + ∂U(q): recursive Newton–Euler.
void inverse_dynamics(const Model& model, Workspace& ws, const ConstVectorRef& q, const ConstVectorRef& v,
                      const ConstVectorRef& a, VectorRef tau);
/// a = M(q)⁻¹ (τ − C v − ∂U): articulated-body algorithm.
void forward_dynamics(const Model& model, Workspace& ws, const ConstVectorRef& q, const ConstVectorRef& v,
                      const ConstVectorRef& tau, VectorRef a);
/// C(q, v) v + ∂U(q).
void bias_torque(const Model& model, Workspace& ws, const ConstVectorRef& q, const ConstVectorRef& v, VectorRef tau);
/// ∂U(q): the torque that holds the arm against gravity.
void gravity_torque(const Model& model, Workspace& ws, const ConstVectorRef& q, VectorRef tau);
/// x = M(q)⁻¹ y, one sweep in and one out. y and x may be the same vector.
void solve_mass(const Model& model, Workspace& ws, const ConstVectorRef& q, const ConstVectorRef& y, VectorRef x);
/// p = M(q) v, O(n).
void momentum(const Model& model, Workspace& ws, const ConstVectorRef& q, const ConstVectorRef& v, VectorRef p);
/// M(q): composite rigid bodies; symmetric, both triangles written.
void mass_matrix(const Model& model, Workspace& ws, const ConstVectorRef& q, Eigen::Ref<Eigen::MatrixXd> M);

/// ½ vᵀM(q)v [J].
[[nodiscard]] double kinetic_energy(const Model& model, Workspace& ws, const ConstVectorRef& q,
                                    const ConstVectorRef& v);
/// U(q) = −Σ m_i g·p_i [J].
[[nodiscard]] double potential_energy(const Model& model, Workspace& ws, const ConstVectorRef& q);

/// The same for all columns at once, as many states to a SIMD register as it has lanes. All matrices are dof × states
/// with one row stride, so whole matrices or like blocks of such; results are those of the single calls but for
/// rounding.
void inverse_dynamics(const Model& model, BatchWorkspace& ws, const ConstStatesRef& q, const ConstStatesRef& v,
                      const ConstStatesRef& a, StatesRef tau);
void forward_dynamics(const Model& model, BatchWorkspace& ws, const ConstStatesRef& q, const ConstStatesRef& v,
                      const ConstStatesRef& tau, StatesRef a);

/// World poses of all links at q, kept in ws until the next call. The functions below read them.
void forward_kinematics(const Model& model, Workspace& ws, const ConstVectorRef& q);
/// World position of a point fixed in link i's COM frame, after forward_kinematics.
[[nodiscard]] Eigen::Vector3d point_position(const Model& model, const Workspace& ws, int link,
                                             const Eigen::Vector3d& point_link);
/// World pose of link i's COM frame, after forward_kinematics.
[[nodiscard]] geometry::SE3 link_pose(const Model& model, const Workspace& ws, int link);
/// World pose of the tip, after forward_kinematics.
[[nodiscard]] geometry::SE3 tip_pose(const Model& model, const Workspace& ws);
/// World centres of all collision shapes, in the order of Model::shapes(), after forward_kinematics.
void shape_centers(const Model& model, const Workspace& ws, std::span<Eigen::Vector3d> centers);
/// Their half axes in world axes, zero for spheres, likewise.
void shape_half_axes(const Model& model, const Workspace& ws, std::span<Eigen::Vector3d> half_axes);

/// J with ẋ = J v for the world point x that moves with link i, after forward_kinematics; 3 × dof, columns past the
/// link are zero.
void point_jacobian(const Model& model, const Workspace& ws, int link, const Eigen::Vector3d& point_world,
                    Eigen::Ref<Matrix3Xd> J);
/// [J_ω; J_x] of that point: 6 × dof, angular rows first, world axes.
void frame_jacobian(const Model& model, const Workspace& ws, int link, const Eigen::Vector3d& point_world,
                    Eigen::Ref<Matrix6Xd> J);
/// row = Jᵀ d for a world point x moving with link i and a world direction d: how the joints move x along d. O(depth).
void point_jacobian_transpose(const Model& model, const Workspace& ws, int link, const Eigen::Vector3d& point_world,
                              const Eigen::Vector3d& direction_world, VectorRef row);
/// World velocity of a world point that moves with link i, after forward_kinematics.
[[nodiscard]] Eigen::Vector3d point_velocity(const Model& model, const Workspace& ws, int link,
                                             const Eigen::Vector3d& point_world, const ConstVectorRef& v);

/// At `point_link` (link's COM frame) of link `link` acts the force w × (velocity of that point), w in the world frame
/// [N s/m]: it turns motion and does no work.
struct GyroscopicTerm {
  int link = 0;
  Eigen::Vector3d point_link = Eigen::Vector3d::Zero();
  Eigen::Vector3d w_world = Eigen::Vector3d::Zero();
};

/// Joint torques of gyroscopic terms, Σ J_pᵀ (w × J_p v). O(n + terms). Overwrites the poses in ws with those at q.
void gyroscopic_torque(const Model& model, Workspace& ws, const ConstVectorRef& q, const ConstVectorRef& v,
                       std::span<const GyroscopicTerm> terms, VectorRef tau);

/// Operational-space inertia M_x of (21), the inverse of Λ⁻¹ = J M⁻¹ Jᵀ (3 × 3, world axes), damped: eigenvalue d of
/// Λ⁻¹ becomes d/(d² + λ²), so a lost direction gets zero, not 1/λ.
[[nodiscard]] Eigen::Matrix3d operational_inertia(const Model& model, Workspace& ws, const ConstVectorRef& q,
                                                  const ConstRef<Matrix3Xd>& J, double damping = 1e-3);

}  // namespace hamelin::dynamics

#include "hamelin/dynamics/checked_calls.hpp"

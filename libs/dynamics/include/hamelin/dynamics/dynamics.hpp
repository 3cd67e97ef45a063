#pragma once
#include <Eigen/Core>
#include <span>

#include "hamelin/dynamics/vector_ref.hpp"
#include "hamelin/dynamics/workspace.hpp"
#include "hamelin/model/model.hpp"

/// Recursive algorithms for an open chain, in O(n) time except the mass matrix. A `Model` is const
/// and may be shared; a `Workspace` holds the scratch memory of one thread; no function here
/// allocates. Joint vectors have one number per joint (dof), and the product of torques and rates
/// is in watts. Derivations: chapter 2 of docs/theory.md.
///
/// Every call checks the sizes of its arguments and whether the workspace was made for this model.
/// It throws an Error (usage) that names the function, the argument, what was given and what was
/// expected. Results are written in place and never resized. Arguments are not checked for NaN or
/// infinity; an argument that is not finite gives a result that is not finite.
///
/// A result may share memory with arguments in any way: a call has read all of its arguments before
/// it writes the first number. Only the functions of many states (BatchWorkspace) restrict this.
namespace hamelin::dynamics {

using Eigen::VectorXd;
using model::Model;
using Matrix3Xd = Eigen::Matrix<double, 3, Eigen::Dynamic>;
using Matrix6Xd = Eigen::Matrix<double, 6, Eigen::Dynamic>;
/// Joint vectors of many states, dof × states, stored row by row: all states of a joint are
/// adjacent.
using StatesXd = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using ConstStatesRef = ConstRef<StatesXd>;
using StatesRef = Eigen::Ref<StatesXd>;

/// τ = M(q) a + C(q, v) v + ∂U(q): recursive Newton–Euler, docs/theory.md (2.9)–(2.11).
void inverse_dynamics(const Model& model, Workspace& ws, const ConstVectorRef& q,
                      const ConstVectorRef& v, const ConstVectorRef& a, VectorRef tau);
/// a = M(q)⁻¹ (τ − C v − ∂U): articulated-body algorithm, docs/theory.md (2.12)–(2.15).
void forward_dynamics(const Model& model, Workspace& ws, const ConstVectorRef& q,
                      const ConstVectorRef& v, const ConstVectorRef& tau, VectorRef a);
/// C(q, v) v + ∂U(q).
void bias_torque(const Model& model, Workspace& ws, const ConstVectorRef& q,
                 const ConstVectorRef& v, VectorRef tau);
/// ∂U(q): the torque that holds the arm against gravity.
void gravity_torque(const Model& model, Workspace& ws, const ConstVectorRef& q, VectorRef tau);
/// x = M(q)⁻¹ y, by one sweep inwards and one outwards.
void solve_mass(const Model& model, Workspace& ws, const ConstVectorRef& q, const ConstVectorRef& y,
                VectorRef x);
/// p = M(q) v, O(n).
void momentum(const Model& model, Workspace& ws, const ConstVectorRef& q, const ConstVectorRef& v,
              VectorRef p);
/// M(q) by composite rigid bodies. Both triangles of the symmetric matrix are written.
void mass_matrix(const Model& model, Workspace& ws, const ConstVectorRef& q,
                 Eigen::Ref<Eigen::MatrixXd> M);

/// ½ vᵀM(q)v [J], docs/theory.md (2.3).
[[nodiscard]] double kinetic_energy(const Model& model, Workspace& ws, const ConstVectorRef& q,
                                    const ConstVectorRef& v);
/// U(q) = −Σ m_i g·p_i [J], docs/theory.md (2.4).
[[nodiscard]] double potential_energy(const Model& model, Workspace& ws, const ConstVectorRef& q);

/// As above for all columns, with one state per lane of a SIMD register. All matrices are
/// dof × states with the same row stride: whole matrices, or equal blocks of matrices of one size.
/// Results equal those of single calls up to rounding. The result may be the same block as an
/// argument; one that overlaps an argument in part is refused.
void inverse_dynamics(const Model& model, BatchWorkspace& ws, const ConstStatesRef& q,
                      const ConstStatesRef& v, const ConstStatesRef& a, StatesRef tau);
void forward_dynamics(const Model& model, BatchWorkspace& ws, const ConstStatesRef& q,
                      const ConstStatesRef& v, const ConstStatesRef& tau, StatesRef a);

/// World poses of all links at q, stored in ws until the next call. The functions below that are
/// called after it read them, and refuse a workspace without poses.
void forward_kinematics(const Model& model, Workspace& ws, const ConstVectorRef& q);
/// World position of a point fixed in link i's COM frame, after forward_kinematics.
[[nodiscard]] Eigen::Vector3d point_position(const Model& model, const Workspace& ws, int link,
                                             const Eigen::Vector3d& point_link);
/// World pose of link i's COM frame, after forward_kinematics.
[[nodiscard]] geometry::SE3 link_pose(const Model& model, const Workspace& ws, int link);
/// World pose of the tip, after forward_kinematics.
[[nodiscard]] geometry::SE3 tip_pose(const Model& model, const Workspace& ws);
/// World centres of all collision shapes, in the order of Model::shapes(), after
/// forward_kinematics.
void shape_centers(const Model& model, const Workspace& ws, std::span<Eigen::Vector3d> centers);
/// Half axes of all collision shapes in world axes, zero for spheres; order and precondition as
/// above.
void shape_half_axes(const Model& model, const Workspace& ws, std::span<Eigen::Vector3d> half_axes);

/// J with ẋ = J v for the world point x that moves with the link, after forward_kinematics. J is
/// 3 × dof, docs/theory.md (2.20); the columns of joints outboard of the link are zero.
void point_jacobian(const Model& model, const Workspace& ws, int link,
                    const Eigen::Vector3d& point_world, Eigen::Ref<Matrix3Xd> J);
/// [J_ω; J_x] of that point: 6 × dof, angular rows first, world axes.
void frame_jacobian(const Model& model, const Workspace& ws, int link,
                    const Eigen::Vector3d& point_world, Eigen::Ref<Matrix6Xd> J);
/// row = Jᵀ d for a world point x that moves with the link and a world direction d: the rate of x
/// along d per joint rate. O(depth of the link).
void point_jacobian_transpose(const Model& model, const Workspace& ws, int link,
                              const Eigen::Vector3d& point_world,
                              const Eigen::Vector3d& direction_world, VectorRef row);
/// World velocity of a world point that moves with the link, after forward_kinematics.
[[nodiscard]] Eigen::Vector3d point_velocity(const Model& model, const Workspace& ws, int link,
                                             const Eigen::Vector3d& point_world,
                                             const ConstVectorRef& v);

/// The force w × (velocity of the point), which acts at `point_link` (in the link's COM frame) of
/// link `link`; w is in the world frame [N s/m]. It is perpendicular to the velocity and does no
/// work.
struct GyroscopicTerm {
  int link = 0;
  Eigen::Vector3d point_link = Eigen::Vector3d::Zero();
  Eigen::Vector3d w_world = Eigen::Vector3d::Zero();
};

/// Joint torques of gyroscopic terms, Σ J_pᵀ (w × J_p v), docs/theory.md (2.22). O(n + terms).
/// Overwrites the poses in ws with those at q.
void gyroscopic_torque(const Model& model, Workspace& ws, const ConstVectorRef& q,
                       const ConstVectorRef& v, std::span<const GyroscopicTerm> terms,
                       VectorRef tau);

/// Operational-space inertia M_x, the damped inverse of Λ⁻¹ = J M⁻¹ Jᵀ (3 × 3, world axes),
/// docs/theory.md (2.21): an eigenvalue d of Λ⁻¹ becomes d/(d² + λ²) with λ = `damping`. A
/// direction in which J loses rank gets zero.
[[nodiscard]] Eigen::Matrix3d operational_inertia(const Model& model, Workspace& ws,
                                                  const ConstVectorRef& q,
                                                  const ConstRef<Matrix3Xd>& J,
                                                  double damping = 1e-3);

}  // namespace hamelin::dynamics

#include "hamelin/dynamics/checked_calls.hpp"

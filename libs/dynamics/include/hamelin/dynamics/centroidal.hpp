#pragma once
#include <Eigen/Core>

#include "hamelin/dynamics/frames.hpp"

/// The moving links as one system, docs/theory.md (2.40)–(2.42). Functions read the poses of
/// forward_kinematics, in O(n). Rotors do not count.
namespace hamelin::dynamics {

/// Mass of all moving links [kg].
[[nodiscard]] double total_mass(const Model& model);

/// Their common centre of mass in the world [m]; the first link's frame origin if they have no
/// mass.
/// @throws Error usage for a workspace of another model, or without poses
[[nodiscard]] Eigen::Vector3d center_of_mass(const Model& model, const Workspace& ws);

/// Momentum of all links: angular about the common centre of mass, then linear, world axes
/// [Nm s; N s].
/// @throws as center_of_mass, and for the size of v
[[nodiscard]] Vector6d centroidal_momentum(const Model& model, const Workspace& ws,
                                           const ConstVectorRef& v);

/// A with A v the centroidal momentum, 6 × dof. Its lower three rows over the mass are the Jacobian
/// of the centre of mass.
/// @throws as center_of_mass, and for the size of A
void centroidal_matrix(const Model& model, const Workspace& ws, Eigen::Ref<Matrix6Xd> A);

}  // namespace hamelin::dynamics

#pragma once
#include <Eigen/Core>

#include "hamelin/dynamics/derivatives.hpp"

/// Inverse dynamics as a linear function of masses and inertias, docs/theory.md (2.43)–(2.47).
namespace hamelin::dynamics {

/// Per link: mass [kg], first moment x, y, z [kg m], and inertia xx, yy, zz, xy, xz, yz [kg m²],
/// both about the origin and in the axes of the link's joint-aligned frame.
inline constexpr Eigen::Index inertial_parameters_per_link = 10;

/// π, those of all links, one link after the other.
[[nodiscard]] VectorXd inertial_parameters(const Model& model);

/// Y, dof × 10 dof, with Y π = τ of inverse_dynamics for robots without rotor inertias. Overwrites
/// the poses in ws. Y must not share memory with the arguments.
/// @throws Error usage for sizes or a workspace that do not fit the model
void inverse_dynamics_regressor(const Model& model, Workspace& ws, const ConstVectorRef& q,
                                const ConstVectorRef& v, const ConstVectorRef& a, MatrixRef Y);

/// P and L, each dof × 10 dof, with P π = M v, the generalised momentum [Nm s or N s], and
/// L π = ∂/∂q (T − U), the part of its rate that no torque makes [Nm or N], both for robots without
/// rotor inertias: τ = d(P π)/dt − L π needs no acceleration. docs/theory.md (2.46), (2.47).
/// Overwrites the poses in ws. P and L must not share memory with the arguments.
/// @throws Error usage for sizes or a workspace that do not fit the model
void momentum_regressor(const Model& model, Workspace& ws, const ConstVectorRef& q,
                        const ConstVectorRef& v, MatrixRef P, MatrixRef L);

/// The robot of a model with other masses, centres of mass and inertias; shapes stay where they
/// are. The axes of the COM frames stay, and so do centres of mass of links without mass.
/// @throws Error usage for the size of the parameters; invalid as model::check
[[nodiscard]] model::Robot with_inertial_parameters(const Model& model, const VectorXd& parameters);

}  // namespace hamelin::dynamics

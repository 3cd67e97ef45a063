#pragma once
#include <Eigen/Core>
#include <vector>

#include "hamelin/log/provenance.hpp"
#include "hamelin/model/robot.hpp"
#include "hamelin/scene/scene.hpp"

/// What closed loop and free motion take from a scene alike.
namespace hamelin::simulation {

/// Viscous damping of each joint, as the scene asks for it; empty for none.
/// @throws Error invalid if there is another number of them than of joints
[[nodiscard]] Eigen::VectorXd plant_damping(const scene::Scene& scene, const model::Robot& robot);

/// Dry friction of each joint [Nm or N], as the scene's model asks for it; empty for none.
/// @throws Error invalid if there is another number of them than of joints
[[nodiscard]] Eigen::VectorXd plant_friction(const scene::Scene& scene, const model::Robot& robot);

/// The files of scene, robot and spheres.
[[nodiscard]] std::vector<log::Input> inputs_of(const scene::Scene& scene);

/// The scene with every default written out, the integrator's too; the planner's are its plugin's to know.
[[nodiscard]] Json resolved_config(const scene::Scene& scene);

}  // namespace hamelin::simulation

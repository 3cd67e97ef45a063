#pragma once
#include <Eigen/Core>
#include <vector>

#include "hamelin/log/provenance.hpp"
#include "hamelin/model/robot.hpp"
#include "hamelin/scene/scene.hpp"

/// What closed loop and free motion both read from a scene.
namespace hamelin::simulation {

/// Viscous damping of each joint, as the scene specifies it; empty: none.
/// @throws Error invalid if there is neither one value nor one per joint
[[nodiscard]] Eigen::VectorXd plant_damping(const scene::Scene& scene, const model::Robot& robot);

/// Dry friction of each joint [Nm or N], as model and actuation of the scene specify it; empty:
/// none.
/// @throws Error invalid if there is neither one value nor one per joint
[[nodiscard]] Eigen::VectorXd plant_friction(const scene::Scene& scene, const model::Robot& robot);

/// The values of /actuation/servo/`key`, one per joint.
/// @throws Error invalid if there is neither one value nor one per joint
[[nodiscard]] Eigen::VectorXd servo_values(const scene::Scene& scene,
                                           const std::vector<double>& values, const char* key,
                                           int dof);

/// What the role of an input begins with that a parameter of the planner names: this, its name.
inline constexpr std::string_view planner_file_role = "planner_";

/// The files of scene, robot and spheres.
[[nodiscard]] std::vector<log::Input> inputs_of(const scene::Scene& scene);

/// The scene with all defaults, including the integrator's. Those of the planner are known to its
/// plugin only.
[[nodiscard]] Json resolved_config(const scene::Scene& scene);

}  // namespace hamelin::simulation

#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <string_view>
#include <vector>

#include "hamelin/model/model.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/scene/payload.hpp"
#include "hamelin/scene/scene.hpp"

/// Loading and checking what a controller is made from.
namespace hamelin::control {

/// The robot of a scene as a model: file, tip, spheres, payload, armature, base, gravity.
/// @throws Error io, parse or invalid
[[nodiscard]] model::Model load_model(const scene::Scene& scene);

/// The same arm with all masses and inertias scaled by one factor: what a planner believes.
[[nodiscard]] model::Model scaled_masses(const model::Model& arm, double scale);

/// One value for all joints, or one per joint, as one per joint.
/// @param place of the values, which begins the message of an error
/// @throws Error invalid if there is neither one value nor one per joint
[[nodiscard]] Eigen::VectorXd one_or_per_joint(const std::vector<double>& values, int dof,
                                               std::string_view place);

/// One value per joint as a scene gives it under /model/`key`; of size zero: none.
/// @param member where the robot file has it
/// @throws Error invalid if there is neither one value nor one per joint
[[nodiscard]] Eigen::VectorXd joint_numbers(const scene::Scene& scene,
                                            const scene::JointNumbers& given, const char* key,
                                            const model::Robot& robot,
                                            double model::Joint::*member);

/// Checks that start, goals and limits fit the robot. @throws Error invalid, naming the place in
/// the scene
void check_numbers(const scene::Scene& scene, const model::Model& model);

/// The planner that the scene names. @throws Error invalid or plugin
[[nodiscard]] planning::Plugin find_planner(const scene::Scene& scene,
                                            const std::vector<std::filesystem::path>& directories);

/// The parameters of the scene's planner, checked and with defaults. @throws Error invalid
[[nodiscard]] Json planner_params(const scene::Scene& scene, const planning::Plugin& plugin);

}  // namespace hamelin::control

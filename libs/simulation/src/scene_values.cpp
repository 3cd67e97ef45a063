#include "scene_values.hpp"

#include <fmt/format.h>

#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/preparation.hpp"

namespace hamelin::simulation {

Eigen::VectorXd plant_damping(const scene::Scene& scene, const model::Robot& robot) {
  return control::joint_numbers(scene, scene.model.joint_damping, "joint_damping", robot,
                                &model::Joint::damping);
}

Eigen::VectorXd plant_friction(const scene::Scene& scene, const model::Robot& robot) {
  Eigen::VectorXd friction = control::joint_numbers(scene, scene.model.friction, "friction", robot,
                                                    &model::Joint::friction);
  const double share = scene.actuation.coulomb_friction_share;
  if (share == 0.0) return friction;
  if (friction.size() == 0) friction = Eigen::VectorXd::Zero(robot.dof());
  return friction + share * control::joint_limits(robot, &model::Joint::effort_max, 0.0);
}

Eigen::VectorXd servo_values(const scene::Scene& scene, const std::vector<double>& values,
                             const char* key, int dof) {
  return control::one_or_per_joint(values, dof,
                                   fmt::format("{}: /actuation/servo/{}", scene.name, key));
}

std::vector<log::Input> inputs_of(const scene::Scene& scene) {
  std::vector<log::Input> inputs;
  std::error_code ec;
  if (scene.name != scene.robot.file && std::filesystem::is_regular_file(scene.name, ec))
    inputs.push_back({"scene", scene.name});
  inputs.push_back({"robot", scene.robot.file});
  if (scene.robot.spheres) inputs.push_back({"spheres", *scene.robot.spheres});
  if (scene.robot.srdf) inputs.push_back({"srdf", *scene.robot.srdf});
  return inputs;
}

Json resolved_config(const scene::Scene& scene) {
  Json config = scene::resolved_json(scene);
  Json& params = config["integrator"]["params"];
  params = with_defaults(params, shipped_schema("integrator"));
  return config;
}

}  // namespace hamelin::simulation

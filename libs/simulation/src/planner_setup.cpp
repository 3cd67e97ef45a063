#include "planner_setup.hpp"

#include <fmt/format.h>

#include <utility>

#include "actuation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "plant.hpp"

namespace hamelin::simulation {

using Eigen::VectorXd;

namespace {

hamelin_goal to_c(const scene::Goal& goal) {
  hamelin_goal out{};
  out.type = goal.type == scene::GoalType::joint      ? HAMELIN_GOAL_JOINT
             : goal.type == scene::GoalType::position ? HAMELIN_GOAL_POSITION
                                                      : HAMELIN_GOAL_POSE;
  const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(goal.pose.R());
  for (int i = 0; i < 3; ++i) out.position_world_m[i] = goal.pose.p()[i];
  for (int i = 0; i < 4; ++i) out.quaternion_wxyz[i] = wxyz[i];
  out.tolerance_m = goal.tolerance_m;
  out.tolerance_rad = goal.tolerance_rad;
  out.speed_max = goal.speed_max;
  return out;
}

}  // namespace

void check_numbers(const scene::Scene& scene, const model::Model& model) {
  const auto sized = [&](const VectorXd& x, const std::string& place) {
    if (x.size() != model.dof())
      throw Error(ErrorCode::invalid, fmt::format("{}: {}: {} numbers given, expected {}, one a joint of '{}'",
                                                  scene.name, place, x.size(), model.dof(), model.robot().name));
  };
  if (scene.start_q.size() > 0) sized(scene.start_q, "/start/q");
  if (scene.start_v.size() > 0) sized(scene.start_v, "/start/v");
  for (std::size_t i = 0; i < scene.goals.size(); ++i)
    if (scene.goals[i].type == scene::GoalType::joint)
      sized(scene.goals[i].q, fmt::format("/goals/{}/q{}", i, scene.goals[i].path.size() > 0 ? "/0" : ""));
  if (scene.actuation.coulomb_friction_share > 0.0)
    for (const auto& link : model.robot().links)
      if (!link.joint.effort_max)
        throw Error(ErrorCode::invalid,
                    fmt::format("{}: /actuation/coulomb_friction_share: is a share of effort limits, but joint '{}' of "
                                "'{}' has none",
                                scene.name, link.joint.name, model.robot().name));
  if (scene.goals.empty())
    throw Error(ErrorCode::invalid, fmt::format("{}: /goals: is empty, expected at least one goal", scene.name));
}

planning::Plugin find_planner(const scene::Scene& scene, const std::vector<std::filesystem::path>& directories) {
  if (!scene.planner)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: /planner: is missing, expected the name of a planner", scene.name));
  return planning::find_plugin(scene.planner->name, directories);
}

model::Model scaled_masses(const model::Model& arm, double scale) {
  model::Robot robot = arm.robot();
  for (auto& link : robot.links) {
    link.mass_kg *= scale;
    link.inertia_kg_m2 *= scale;
    link.joint.armature *= scale;
  }
  return model::Model(std::move(robot), arm.base(), arm.gravity());
}

planning::SetupData planner_setup(const scene::Scene& scene, const model::Model& nominal,
                                  const control::WorldView& world) {
  planning::SetupData data(nominal);
  for (const auto& goal : scene.goals)
    data.add_goal(to_c(goal), goal.type == scene::GoalType::joint ? goal.q : VectorXd(), goal.path);
  const auto& robot = nominal.robot();
  if (scene.model.joint_limits) {
    data.q_lower = joint_limits(robot, &model::Joint::lower, -infinity);
    data.q_upper = joint_limits(robot, &model::Joint::upper, infinity);
  }
  if (scene.model.velocity_limits) data.velocity_max = joint_limits(robot, &model::Joint::velocity_max, infinity);
  if (scene.model.torque_limits) data.effort_max = joint_limits(robot, &model::Joint::effort_max, infinity);
  if (scene.actuation.torque_rate_max_Nm_s)
    data.effort_rate_max = VectorXd::Constant(nominal.dof(), *scene.actuation.torque_rate_max_Nm_s);
  data.sampled = scene.actuation.type == scene::ActuationType::sampled;
  data.delay_s = scene.actuation.delay_s;
  data.control_period_s = static_cast<double>(steps_per_tick(scene)) * scene.step_s;
  data.self_collision = scene.model.self_collision;
  data.influence_m = world.influence_m();
  data.map_resolution_m = world.environment().summary().resolution_m;
  data.seed = scene.seed;
  return data;
}

}  // namespace hamelin::simulation

#include "hamelin/control/preparation.hpp"

#include <fmt/format.h>

#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "loop/goal_list.hpp"

namespace hamelin::control {

using Eigen::VectorXd;

VectorXd one_or_per_joint(const std::vector<double>& values, int dof, std::string_view place) {
  if (values.size() == 1) return VectorXd::Constant(dof, values.front());
  if (values.size() != static_cast<std::size_t>(dof))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: {} values given, expected 1 or {}", place, values.size(), dof));
  return VectorXd::Map(values.data(), dof);
}

VectorXd joint_numbers(const scene::Scene& scene, const scene::JointNumbers& given, const char* key,
                       const model::Robot& robot, double model::Joint::*member) {
  const int n = robot.dof();
  if (given.from_robot) {
    Eigen::VectorXd values(n);
    for (int i = 0; i < n; ++i) values[i] = robot.links[static_cast<std::size_t>(i)].joint.*member;
    return values.isZero(0.0) ? Eigen::VectorXd() : values;
  }
  if (given.values.empty()) return {};
  return one_or_per_joint(given.values, n, fmt::format("{}: /model/{}", scene.name, key));
}

model::Model load_model(const scene::Scene& scene) {
  model::Robot robot = description::read_robot(
      scene.robot.file, {scene.robot.tip, scene.robot.spheres, scene.robot.srdf});
  if (scene.model.payload)
    robot = scene::with_payloads(std::move(robot), {&*scene.model.payload, 1});
  if (!scene.model.armature.from_robot) {
    const Eigen::VectorXd armature =
        joint_numbers(scene, scene.model.armature, "armature", robot, &model::Joint::armature);
    for (int i = 0; i < robot.dof(); ++i)
      robot.links[static_cast<std::size_t>(i)].joint.armature =
          armature.size() > 0 ? armature[i] : 0.0;
  }
  return model::Model(std::move(robot), scene.base, scene.gravity_m_s2);
}

model::Model scaled_masses(const model::Model& arm, double scale) {
  if (scale == 1.0) return arm;
  model::Robot robot = arm.robot();
  for (auto& link : robot.links) {
    link.mass_kg *= scale;
    link.inertia_kg_m2 *= scale;
    link.joint.armature *= scale;
  }
  return model::Model(std::move(robot), arm.base(), arm.gravity());
}

namespace {

// What a file's schema checks, of scenes that a program has made or changed.
void check_bounds(const scene::Scene& scene) {
  const auto within = [&](double x, double least, double most, const char* place) {
    if (!(x >= least && x <= most))
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: {}: {}, expected {} to {}", scene.name, place, x, least, most));
  };
  constexpr double large = 1e9, tiny = 1e-9;
  const scene::SafetyBounds safety = scene::safety_bounds(scene);
  within(safety.margin_m, 0.0, large, "/safety/margin_m");
  within(safety.torque_share, tiny, 1.0, "/safety/torque_share");
  within(safety.tracking_rad, 0.0, large, "/safety/tracking_rad");
  within(safety.mass_error, 0.0, 1.0, "/safety/mass_error");
  within(safety.friction_share, 0.0, 1.0, "/safety/friction_share");
  within(safety.joint_noise_rad, 0.0, large, "/safety/joint_noise_rad");
  const scene::Actuation& actuation = scene.actuation;
  within(actuation.delay_s, 0.0, 1.0, "/actuation/delay_s");
  within(actuation.estimator_bandwidth, tiny, large, "/actuation/estimator_bandwidth");
  within(actuation.planner_mass_scale, tiny, large, "/actuation/planner_mass_scale");
  within(actuation.torque_rate_max_Nm_s.value_or(1.0), tiny, large,
         "/actuation/torque_rate_max_Nm_s");
  within(actuation.deadline_s.value_or(1.0), 0.0, large, "/actuation/deadline_s");
}

// Calls `sized` with the joints of a goal, or of its options, and where they stand.
template <class Sized>
void each_joints(const scene::Goal& goal, const std::string& place, const Sized& sized) {
  for (std::size_t k = 0; k < goal.any_of.size(); ++k)
    each_joints(goal.any_of[k], fmt::format("{}/any_of/{}", place, k), sized);
  if (goal.type == scene::GoalType::joint)
    sized(goal.q, place + (goal.path.size() > 0 ? "/q/0" : "/q"));
}

}  // namespace

void check_numbers(const scene::Scene& scene, const model::Model& model) {
  check_bounds(scene);
  const auto sized = [&](const VectorXd& x, const std::string& place) {
    if (x.size() != model.dof())
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: {}: {} values given, expected {} (one per joint of '{}')",
                              scene.name, place, x.size(), model.dof(), model.robot().name));
  };
  if (scene.start_q.size() > 0) sized(scene.start_q, "/start/q");
  if (scene.start_v.size() > 0) sized(scene.start_v, "/start/v");
  for (std::size_t i = 0; i < scene.goals.size(); ++i)
    if (scene.goals[i].trajectory) {
      if (const std::string defect = joints_defect(*scene.goals[i].trajectory, model);
          !defect.empty())
        throw Error(ErrorCode::invalid, fmt::format("{}: /goals/{}: {}", scene.name, i, defect));
    } else {
      each_joints(scene.goals[i], fmt::format("/goals/{}", i), sized);
    }
  if (scene.actuation.coulomb_friction_share > 0.0)
    for (const auto& link : model.robot().links)
      if (!link.joint.effort_max)
        throw Error(ErrorCode::invalid,
                    fmt::format("{}: /actuation/coulomb_friction_share: is a share of effort "
                                "limits, but joint '{}' of "
                                "'{}' has none",
                                scene.name, link.joint.name, model.robot().name));
  if (scene.goals.empty())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: /goals: is empty, expected at least one goal", scene.name));
}

planning::Plugin find_planner(const scene::Scene& scene,
                              const std::vector<std::filesystem::path>& directories) {
  if (!scene.planner)
    throw Error(
        ErrorCode::invalid,
        fmt::format("{}: /planner: is missing, expected the name of a planner", scene.name));
  return planning::find_plugin(scene.planner->name, directories);
}

Json planner_params(const scene::Scene& scene, const planning::Plugin& plugin) {
  try {
    return planning::check_params(plugin, scene.planner->params);
  } catch (const Error& e) {
    throw Error(e.code(), fmt::format("{}: /planner/params: {}", scene.name, e.what()));
  }
}

}  // namespace hamelin::control

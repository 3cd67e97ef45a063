#include "hamelin/control/planner_setup.hpp"

#include <cmath>
#include <utility>

#include "hamelin/core/numbers.hpp"
#include "hamelin/scene/modelled.hpp"
#include "loop/goal_list.hpp"

namespace hamelin::control {

using Eigen::VectorXd;

VectorXd joint_limits(const model::Robot& robot, std::optional<double> model::Joint::*limit,
                      double unlimited) {
  VectorXd limits(robot.dof());
  for (int i = 0; i < robot.dof(); ++i)
    limits[i] = (robot.links[static_cast<std::size_t>(i)].joint.*limit).value_or(unlimited);
  return limits;
}

namespace {

// Limits inside those of the shield, but not beyond the start or a goal.
void narrow(const scene::Scene& scene, const VectorXd& reserve, VectorXd& lower, VectorXd& upper) {
  VectorXd low = reserve, high = reserve;
  const auto include = [&](const VectorXd& q) {
    if (q.size() != reserve.size()) return;
    low = low.cwiseMin(q - lower).cwiseMax(0.0);
    high = high.cwiseMin(upper - q).cwiseMax(0.0);
  };
  include(scene.start_q);
  for (const auto& goal : scene.goals)
    for (const auto& option : scene::options_of(goal))
      if (option.type == scene::GoalType::joint) include(option.q);
  lower += low;
  upper -= high;
}

}  // namespace

ModelledLimits modelled_limits(const scene::Scene& scene, const model::Robot& robot) {
  ModelledLimits limits;
  const scene::LimitsInForce in_force = scene::limits_in_force(scene.model, robot);
  if (in_force.position) {
    limits.q_lower = joint_limits(robot, &model::Joint::lower, -infinity);
    limits.q_upper = joint_limits(robot, &model::Joint::upper, infinity);
  }
  if (in_force.velocity)
    limits.velocity_max = joint_limits(robot, &model::Joint::velocity_max, infinity);
  if (in_force.torque) limits.effort_max = joint_limits(robot, &model::Joint::effort_max, infinity);
  return limits;
}

planning::SetupData planner_setup(const scene::Scene& scene, const model::Model& nominal,
                                  const WorldView& world, double control_period_s,
                                  const LimitReserve& reserve) {
  planning::SetupData data(nominal);
  for (const auto& goal : scene.goals) {
    const scene::Goal& first = scene::options_of(goal).front();
    data.add_goal(to_c(goal), first.type == scene::GoalType::joint ? first.q : VectorXd(),
                  first.path);
  }
  ModelledLimits limits = modelled_limits(scene, nominal.robot());
  if (limits.q_lower.size() > 0 && reserve.position.size() > 0)
    narrow(scene, reserve.position, limits.q_lower, limits.q_upper);
  data.q_lower = std::move(limits.q_lower);
  data.q_upper = std::move(limits.q_upper);
  for (Eigen::Index i = 0; i < reserve.velocity.size(); ++i)  // the reserve of infinity is none
    if (std::isfinite(limits.velocity_max[i])) limits.velocity_max[i] -= reserve.velocity[i];
  data.velocity_max = std::move(limits.velocity_max);
  data.effort_max = std::move(limits.effort_max);
  if (scene.actuation.torque_rate_max_Nm_s)
    data.effort_rate_max = VectorXd::Constant(nominal.dof(), *scene.actuation.torque_rate_max_Nm_s);
  data.sampled = scene.actuation.type != scene::ActuationType::ideal;
  // Under position actuation the planner is shown the set points, which change without delay.
  if (scene.actuation.type == scene::ActuationType::sampled) data.delay_s = scene.actuation.delay_s;
  data.control_period_s = control_period_s;
  data.deadline_s = scene.actuation.deadline_s.value_or(control_period_s);
  data.self_collision = scene.model.self_collision;
  data.influence_m = world.influence_m();
  data.map_resolution_m = world.environment().summary().resolution_m;
  data.shield_margin_m = reserve.obstacles_m;
  data.shield_self_margin_m = reserve.self_m;
  data.seed = scene.seed;
  return data;
}

}  // namespace hamelin::control

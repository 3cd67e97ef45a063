#include "published.hpp"

#include <cmath>

namespace hamelin::apf {

using Eigen::Vector3d;
using namespace planning;

Published::Published(const Setup& setup, const Json& params)
    : setup_(setup),
      arm_(setup),
      k_p_(params.at("k_p").get<double>()),
      k_v_(params.at("k_v").get<double>()),
      repulsion_{params.at("eta").get<double>(), params.at("rho0_m").get<double>(),
                 params.at("distance_min_m").get<double>()},
      joint_damping_(params.at("joint_damping").get<double>()),
      potential_mapping_(params.at("mapping") == "potential"),
      goal_scaled_(params.at("law") == "wang2018"),
      goal_exponent_(params.at("goal_exponent").get<double>()),
      gravity_compensation_(params.at("gravity_compensation").get<bool>()),
      tau_(setup.dof()) {}

void Published::tick(const Tick& tick, Command& command) {
  arm_.update(tick);
  command.damping().setConstant(joint_damping_);
  if (potential_mapping_) {
    potential(tick, command);
  } else {
    operational(tick, command);
  }
  if (gravity_compensation_) {
    tau_.setZero();
    arm_.add_gravity(tau_);
    command.held_torque() += tau_;
  }
}

Published::GoalScale Published::goal_scale(double distance_squared) const {
  if (!goal_scaled_) return {1.0, 0.0};
  if (distance_squared == 0.0) return {0.0, 0.0};
  const double n = goal_exponent_;
  return {std::pow(distance_squared, 0.5 * n), n * std::pow(distance_squared, 0.5 * n - 1.0)};
}

double Published::goal_distance_squared(const hamelin_goal& goal) const {
  if (goal.type == HAMELIN_GOAL_JOINT)
    return (arm_.q() - ConstVectorMap(goal.q, arm_.q().size())).squaredNorm();
  return (arm_.tip_position() - vec3(goal.position_world_m)).squaredNorm();
}

void Published::operational(const Tick& tick, Command& command) {
  const hamelin_goal& goal = tick.goal();
  const GoalScale scale = goal_scale(goal_distance_squared(goal));
  double attraction = k_p_ * tick.speed_scale();
  tau_.setZero();
  for_each_nearest(
      tick.contacts(), setup_.shapes(), repulsion_.rho0, [&](const hamelin_contact& c, int link) {
        const Vector3d f = scale.value * repulsion_.force(c.distance_m) * vec3(c.direction_world);
        arm_.add_mapped(link, vec3(c.arm_point_world_m), f, tau_);
        attraction += scale.gradient_factor * repulsion_.potential(c.distance_m);
      });
  arm_.add_mapped_attraction(goal, attraction, k_v_, tau_);
  command.held_torque() = tau_;
}

void Published::potential(const Tick& tick, Command& command) {
  const hamelin_goal& goal = tick.goal();
  const double distance_squared = goal_distance_squared(goal), k_p = k_p_ * tick.speed_scale();
  const GoalScale scale = goal_scale(distance_squared);
  double attraction = k_p, value = 0.5 * k_p * distance_squared;
  tau_.setZero();  // −∂V
  for_each_nearest(
      tick.contacts(), setup_.shapes(), repulsion_.rho0, [&](const hamelin_contact& c, int link) {
        const double V = repulsion_.potential(c.distance_m);
        const Vector3d f = scale.value * repulsion_.force(c.distance_m) * vec3(c.direction_world);
        arm_.add_force(link, vec3(c.arm_point_world_m), f, tau_);
        attraction += scale.gradient_factor * V;
        value += scale.value * V;
      });
  if (goal.type == HAMELIN_GOAL_JOINT) {
    tau_ -= attraction * (arm_.q() - ConstVectorMap(goal.q, arm_.q().size()));
  } else {
    const Vector3d tip = arm_.tip_position();
    arm_.add_force(arm_.tip_link(), tip, -attraction * (tip - vec3(goal.position_world_m)), tau_);
  }
  command.set_potential(value);
  command.potential_gradient() = -tau_;
}

}  // namespace hamelin::apf

#pragma once
#include <Eigen/Core>
#include <optional>

#include "hamelin/control/world_view.hpp"
#include "hamelin/model/robot.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::control {

/// A limit of each joint; `unlimited` for joints without one.
[[nodiscard]] Eigen::VectorXd joint_limits(const model::Robot& robot,
                                           std::optional<double> model::Joint::*limit,
                                           double unlimited);

/// The limits of the joints that are in force, see scene::limits_in_force(); of size zero: none of
/// this kind. Joints for which the robot states none have infinite ones.
struct ModelledLimits {
  Eigen::VectorXd q_lower, q_upper;  ///< [rad or m]
  Eigen::VectorXd velocity_max;      ///< [rad/s or m/s]
  Eigen::VectorXd effort_max;        ///< [Nm or N]
};
[[nodiscard]] ModelledLimits modelled_limits(const scene::Scene& scene, const model::Robot& robot);

/// By how much the limits that a planner is told lie inside those that hold, so that a shield that
/// keeps these has nothing to refuse.
struct LimitReserve {
  Eigen::VectorXd position;  ///< of each joint [rad or m]; of size zero: none
  Eigen::VectorXd velocity;  ///< of each joint [rad/s or m/s]; of size zero: none
  /// What is kept from obstacles, and between parts of the arm, while it moves slowly [m].
  double obstacles_m = 0.0, self_m = 0.0;
};

/// The data that a planner is given before its first tick: goals, limits and timing of a scene, the
/// shapes of the arm and the distance up to which it is shown obstacles.
/// @param nominal the planner's model of the arm
/// @param control_period_s time between two ticks [s]
[[nodiscard]] planning::SetupData planner_setup(const scene::Scene& scene,
                                                const model::Model& nominal, const WorldView& world,
                                                double control_period_s,
                                                const LimitReserve& reserve = {});

}  // namespace hamelin::control

#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "hamelin/dynamics/inverse_kinematics.hpp"
#include "hamelin/planning/joint_path.hpp"
#include "hamelin/planning/plugin.hpp"
#include "margins.hpp"
#include "step_limits.hpp"

namespace hamelin::mppi {

/// A copy of a goal, which stays valid while workers use it.
struct Goal {
  std::int32_t type = HAMELIN_GOAL_JOINT;
  Eigen::VectorXd q;  ///< of a joint goal
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  double tolerance_m = 0.0, tolerance_rad = 0.0;
};

/// Where a goal of the tip asks it to be.
[[nodiscard]] inline dynamics::TipTarget tip_target(const Goal& goal) {
  return {goal.position, goal.rotation, goal.type == HAMELIN_GOAL_POSE, goal.tolerance_m,
          goal.tolerance_rad};
}

/// Weights of the cost, docs/theory.md (15.6), (15.9)–(15.11).
struct CostParams {
  double smoothness_s, clearance_s;
};

/// What the rollouts of one plan share. Workers only read it.
struct Task {
  Task(Eigen::Index dof, Eigen::Index point_count, Eigen::Index path_capacity,
       const Margins& arm_margins)
      : mean(Eigen::MatrixXd::Zero(dof, point_count)),
        best(mean),
        path(dof, path_capacity),
        margins(arm_margins) {}

  StepLimits limits;
  CostParams cost{};
  double spacing_s = 0.0;     ///< of the control points, and the period of plans
  double cruise_speed = 0.0;  ///< converts lengths in joint space to times [rad/s or m/s]
  double noise = 0.0;         ///< standard deviation of the coefficients [rad or m]
  std::uint64_t seed = 0, plan = 0;
  Eigen::MatrixXd mean, best;  ///< control points: the mean, and the best rollout before
  Goal goal;
  bool tip_cost = false;  ///< whether the error of the tip counts, instead of the path
  planning::JointPath path;
  double path_from = 0.0, path_to = 0.0;  ///< arc lengths between which rollouts join the path
  Margins margins;
  double start_clearance_m = 0.0;
  bool moving = false;  ///< whether any obstacle may move
};

constexpr Eigen::Index lane_count = 8;
using Lanes = Eigen::Array<double, lane_count, 1>;

/// Eight rollouts, one per lane.
struct Rollouts {
  Rollouts(Eigen::Index dof, Eigen::Index point_count)
      : count(point_count), points(lane_count, dof * point_count) {
    points.setZero();
  }
  [[nodiscard]] auto point(Eigen::Index joint, Eigen::Index i) {
    return points.col(joint * count + i);
  }
  [[nodiscard]] auto point(Eigen::Index joint, Eigen::Index i) const {
    return points.col(joint * count + i);
  }
  void set_lane(Eigen::Index lane, const Eigen::MatrixXd& from) {
    for (Eigen::Index j = 0; j < from.rows(); ++j)
      for (Eigen::Index i = 0; i < count; ++i) point(j, i)[lane] = from(j, i);
  }
  void get_lane(Eigen::Index lane, Eigen::MatrixXd& to) const {
    for (Eigen::Index j = 0; j < to.rows(); ++j)
      for (Eigen::Index i = 0; i < count; ++i) to(j, i) = point(j, i)[lane];
  }

  Eigen::Index count;  ///< of control points
  Eigen::Array<double, lane_count, Eigen::Dynamic> points;
  Lanes cost = Lanes::Zero(), clearance_m = Lanes::Zero();
  std::array<bool, lane_count> collides{};
};

}  // namespace hamelin::mppi

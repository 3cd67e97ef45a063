#pragma once
#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/optimal/optimize.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::optimal {

/// What is asked of the motion to the goals of a scene, besides what the scene models.
struct SceneMotionOptions {
  Objective objective = Objective::effort;
  int intervals = 50;  ///< to each goal; more where torques between the knots need them
  /// Time to each goal [s]; none: that in which no joint exceeds half of its velocity limit on the
  /// way of the guess. With Objective::time the first guess.
  std::optional<double> duration_s;
  double margin_m = 0.005;                   ///< least clearance, that is proved at all times
  std::optional<double> acceleration, jerk;  ///< limits of all joints [rad/s² and rad/s³, or m]
  double time_effort_weight = 1e-3;          ///< see Problem
  /// Share of the limits of velocity and torque that the motion may use: the rest is for the
  /// feedback of an arm that follows it. None: all of the velocities, and 0.9 of the torques.
  std::optional<double> limit_share;
  SolveOptions solve{};
  /// About the share of the cost that may be left to gain, see SolveOptions; none: 0.005 of the
  /// least time, or 1e-4 of the least effort.
  std::optional<double> cost_tolerance;
};

/// With the tolerances of the options: where time is free, small violations are met by slowing
/// down.
[[nodiscard]] SolveOptions solve_options(const SceneMotionOptions& options);

/// The motion to one goal, at rest at both ends but for the start of the scene.
struct GoalMotion {
  Optimized found;
  /// Whether it keeps all limits at all times and is proved to keep the margin.
  [[nodiscard]] bool valid() const {
    return found.solution.violation <= SolveOptions{}.tolerance && found.proof.certified &&
           found.motion.well_formed();
  }
};

/// The motions of a scene, one after the other.
struct SceneMotion {
  std::string scene, robot;
  std::vector<std::string> joints;
  model::Model model;
  std::vector<GoalMotion> goals;  ///< up to the first that is not valid
  std::size_t goal_count = 0;     ///< of the scene
  /// Whether there is a valid motion to each goal, and at least one goal.
  [[nodiscard]] bool valid() const {
    return !goals.empty() && goals.size() == goal_count &&
           std::all_of(goals.begin(), goals.end(), [](const auto& goal) { return goal.valid(); });
  }
  [[nodiscard]] double duration_s() const;

  struct Point {
    double time_s;
    VectorXd q, v, a, torque;
  };
  /// The knots of all motions, or if a rate is given, that number of points per second, with the
  /// torques along the motion; and the last knot. @throws Error invalid for a rate that is not a
  /// positive number
  [[nodiscard]] std::vector<Point> points(std::optional<double> rate_hz = {}) const;
};

/// Obstacles that are farther away count as being at this distance [m], which is more than the
/// margin.
[[nodiscard]] constexpr double influence_of(double margin_m) {
  return std::max(0.05, 1.5 * margin_m);
}

/// The problem of a scene's motions, but for start, goal, duration and clearance. The model must
/// outlive it.
[[nodiscard]] Problem problem_of(const scene::Scene& scene, const SceneMotionOptions& options,
                                 const model::Model& model);

/// The time in which no joint exceeds half of its velocity limit on the way of guess_along() [s];
/// joints without a limit count as having 2 rad/s or m/s.
[[nodiscard]] double slow_duration(const MatrixXd& way_points, const VectorXd& velocity_limits);

/// Optimises the motion from the start of a scene to its first goal, and from each goal to the
/// next, among the obstacles that stand still. The first guess goes along the paths of the scene's
/// guide, and where none of them gives a valid motion, along those of the next two seeds; without a
/// guide along the goals' own paths, or straight.
/// @throws Error io, parse or invalid for bad input, a start or goal that is nearer to an obstacle
///         than the margin, a scene with damping or friction, goals of the
///         tip without a guide, goals that follow a target, or if the guide finds no path
[[nodiscard]] SceneMotion optimize_scene(const scene::Scene& scene,
                                         const SceneMotionOptions& options);

/// Why a solution is no proved minimum, and what it violates most: one line, or empty.
[[nodiscard]] std::string cause_of(const Solution& solution);

/// As hamelin.trajectory/1, docs/schema/trajectory.schema.json.
[[nodiscard]] Json to_json(const SceneMotion& motion, const SceneMotionOptions& options,
                           std::optional<double> rate_hz = {});

}  // namespace hamelin::optimal

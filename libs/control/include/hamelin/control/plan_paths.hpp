#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/control/world.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/search/postures.hpp"
#include "hamelin/search/search.hpp"
#include "hamelin/timing/timed_path.hpp"

namespace hamelin::control {

/// A motion from rest to rest along a path whose corners it rounds, all of which is proved to be
/// clear.
struct PlannedMotion {
  timing::TimedPath motion;
  double clearance_m = 0.0;  ///< what the arm keeps from obstacles and from itself, at least [m]
};

/// The path to one goal of a scene, with its certificate.
struct PlannedGoal {
  std::string type;  ///< of the goal, as in a scene file
  bool has_way = false;
  search::Path path;
  /// For each straight line of the path, the smallest distance of the arm from obstacles and from
  /// itself that is proved, but for 0.1 mm [m]; at most 0.2 m.
  std::vector<double> clearance_m;
  double search_s = 0.0;  ///< CPU time of the search; no result depends on it
  /// Where it is asked for. The path is then the one along which the fastest motion was found.
  std::optional<PlannedMotion> motion;
  std::string motion_cause;  ///< one line: why there is none
};

/// The paths of a scene's guide, one after the other.
struct PathPlan {
  std::string scene, robot, guide;
  std::vector<std::string> joints;
  std::uint64_t seed = 1;
  std::vector<PlannedGoal> goals;  ///< up to the first without a path
  std::size_t goal_count = 0;      ///< of the scene
  [[nodiscard]] bool found() const noexcept {
    return goals.size() == goal_count && (goals.empty() || goals.back().path.found());
  }
};

/// What is asked for.
struct PlanOptions {
  /// Motions within the limits of the scene, too: docs/theory.md, chapter 19.
  bool motions = false;
  /// Called now and then during searches; it may throw to end them.
  std::function<void()> poll = {};
};

/// Searches a path from the start of a scene to its first goal, and from each goal to the next, in
/// the world as it is at time 0.
/// @throws Error io, parse or invalid for bad input, a scene with guide none, or a goal that
///         follows a target
[[nodiscard]] PathPlan plan_paths(const scene::Scene& scene, const PlanOptions& options = {});
/// The same with the scene's model and a world that were made before.
[[nodiscard]] PathPlan plan_paths(const scene::Scene& scene, const model::Model& arm, World& world,
                                  const PlanOptions& options = {});
/// Configurations at a goal of a scene that are clear in the world as it is at time 0.
/// @param goal its index
/// @throws Error as plan_paths(), and invalid for an index beyond the last goal
[[nodiscard]] search::Postures find_postures(const scene::Scene& scene, std::size_t goal,
                                             const search::PosturesWanted& wanted);
/// The motions of all goals, one after the other, at times that are at most `spacing_s` apart.
/// @throws Error invalid if there is none to some goal, with the cause
[[nodiscard]] scene::JointTrajectory trajectory_of(const PathPlan& plan, double spacing_s);

/// As hamelin.path/1, docs/schema/path.schema.json.
[[nodiscard]] Json to_json(const PathPlan& plan);

}  // namespace hamelin::control

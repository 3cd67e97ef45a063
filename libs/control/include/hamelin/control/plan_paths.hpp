#pragma once
#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "hamelin/control/world.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/search/search.hpp"

namespace hamelin::control {

/// The path to one goal of a scene, with its certificate.
struct PlannedGoal {
  std::string type;  ///< of the goal, as in a scene file
  search::Path path;
  /// For each straight line of the path, the smallest distance of the arm from obstacles and from
  /// itself that is proved, but for 0.1 mm [m]; at most 0.2 m.
  std::vector<double> clearance_m;
  double search_s = 0.0;  ///< CPU time of the search; no result depends on it
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

/// Searches a path from the start of a scene to its first goal, and from each goal to the next, in
/// the world as it is at time 0.
/// @throws Error io, parse or invalid for bad input, a scene with guide none, or a goal that
///         follows a target
/// @param poll called now and then during searches; it may throw to end them
[[nodiscard]] PathPlan plan_paths(const scene::Scene& scene,
                                  const std::function<void()>& poll = {});
/// The same with the scene's model and a world that were made before.
[[nodiscard]] PathPlan plan_paths(const scene::Scene& scene, const model::Model& arm, World& world,
                                  const std::function<void()>& poll = {});

/// As hamelin.path/1, docs/schema/path.schema.json.
[[nodiscard]] Json to_json(const PathPlan& plan);

}  // namespace hamelin::control

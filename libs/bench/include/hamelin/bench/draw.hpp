#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "hamelin/bench/problem_set.hpp"

namespace hamelin::bench {

struct DrawOptions {
  std::string name;
  RobotFiles robot;
  std::vector<std::string> families;  ///< empty: all of the kind that is drawn
  std::size_t per_family = 10;        ///< where obstacles move: per cell of a family
  std::uint64_t seed = 1;
  double resolution_m = 0.01;
  double clearance_m = 0.02;          ///< of start and goal from the map or ground, at least
  double self_clearance_m = 0.01;     ///< of the arm from itself at start and goal, at least
  double joint_margin_rad = 0.05;     ///< of start and goal from the limits of the joints
  double min_distance_rad = 1.0;      ///< Euclidean distance of start and goal
  std::size_t max_draws = 2'000'000;  ///< configurations per start or goal
  std::size_t max_candidates = 100;   ///< per problem
  std::filesystem::path scratch;      ///< directory for temporary files, which are removed
  std::function<void(std::size_t done, std::size_t all)> on_problem;
};

/// Draws a set. A candidate is taken if start and goal keep the clearance, the straight joint
/// motion between them meets an obstacle or the arm itself, and a guide (RRT-Connect) finds a path
/// that is proved clear, along which the judge, too, finds no contact after it was rounded to 0.1
/// mrad.
/// @throws Error invalid if a family yields too few problems
[[nodiscard]] ProblemSet draw_problem_set(const DrawOptions& options);

/// Draws a set whose obstacles move: `per_family` problems of each cell. Start and goal keep the
/// clearance from the ground; the sum over the origins of the links and the tip of the ways from
/// the start by the middle of the straight joint motion to the goal is at least 5 m.
/// @throws Error invalid if a cell yields too few problems
[[nodiscard]] ProblemSet draw_moving_set(const DrawOptions& options);

}  // namespace hamelin::bench

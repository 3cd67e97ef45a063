#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/sweep/plan.hpp"

namespace hamelin::bench {

/// A problem: its clutter follows from family and seed.
struct Problem {
  std::string name, family;
  std::uint64_t seed = 1;
  /// dof × number of way-points [rad]: a path without contact from the start (the first column) to
  /// the goal (the last one), which proves that the problem has a solution. Planners do not see it.
  /// Start and goal only where obstacles move.
  Eigen::MatrixXd path;
  std::string sha256;      ///< of the problem's file
  std::string map_sha256;  ///< of the map that planners see; empty where obstacles move
  /// Of families of moving obstacles: their number, and the largest speed of any point of them.
  std::size_t obstacles = 0;
  double speed_max_m_s = 0.0;
};

/// The arm of all problems of a set.
struct RobotFiles {
  std::filesystem::path robot, spheres;  ///< spheres may be empty
  std::string tip;                       ///< may be empty: the robot's own
};

/// How a set was drawn: candidates, and why some of them were not taken.
struct DrawCounts {
  std::uint64_t candidates = 0;
  std::uint64_t no_start_or_goal = 0;  ///< no free configuration with the tip in a room was found
  std::uint64_t straight_is_free = 0;  ///< the straight joint motion from start to goal is free
  std::uint64_t path_unknown = 0;      ///< no path was found: whether there is one is not known
  std::uint64_t no_room = 0;           ///< no room for obstacles that move
};

/// A set of problems, hamelin.problems/1.
struct ProblemSet {
  std::string name;
  RobotFiles robot;
  double resolution_m = 0.01;      ///< of the maps; 0 if there are none
  double clearance_m = 0.02;       ///< of start and goal from the map or the ground, at least
  double self_clearance_m = 0.01;  ///< of the arm from itself at start and goal, at least
  DrawCounts drawn;
  std::vector<Problem> problems;
  std::string sha256;  ///< of the set's file, which holds the hashes of all other files
};

/// The text of a set's file; the same set gives the same bytes.
/// @param directory that the file will be in: paths are relative to it
[[nodiscard]] std::string to_text(const ProblemSet& set, const std::filesystem::path& directory);
/// Reads a set and checks that its robot is the one that it was drawn for.
/// @throws Error io, parse or invalid
[[nodiscard]] ProblemSet read_problem_set(const std::filesystem::path& file);

/// The problem as a MotionBenchMaker problem: start, goal and primitives. Not for families of
/// moving obstacles, see moving_scene.hpp.
[[nodiscard]] std::string problem_text(const Problem& problem);

/// Which problems of a set are used.
struct Selection {
  std::vector<std::string> families;                      ///< empty: all
  std::size_t per_family = static_cast<std::size_t>(-1);  ///< the first ones of each family
  /// The first ones with the same family, number of obstacles and largest speed.
  std::size_t per_cell = static_cast<std::size_t>(-1);
};
/// The selected problems, in the order of the set.
/// @throws Error usage for a family that the set does not have
[[nodiscard]] std::vector<Problem> select(const ProblemSet& set, const Selection& selection);

/// Writes problems to `directory`/NAME.json, and nothing if one of them is not the published one.
/// @param where the set's file, for messages
/// @return the files
/// @throws Error io; invalid if the text of a problem does not have the SHA-256 of the set
[[nodiscard]] std::vector<std::filesystem::path> write_problems(
    const std::vector<Problem>& problems, const std::filesystem::path& directory,
    const std::string& where);

/// Checks that the maps of a plan which was made from these problems are the published ones.
/// @throws Error invalid with the first that is not
void check_maps(const std::vector<Problem>& problems, const sweep::Plan& plan,
                const std::string& where);

}  // namespace hamelin::bench

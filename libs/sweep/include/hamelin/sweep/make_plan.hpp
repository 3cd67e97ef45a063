#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/scene/make.hpp"
#include "hamelin/sweep/pairs.hpp"
#include "hamelin/sweep/plan.hpp"

namespace hamelin::sweep {

/// Random clutter around the arm of a base scene, whose map and obstacles are not used.
struct ClutterScenes {
  std::size_t maps = 0;    ///< clutters by seed, `clutter.seed` the first
  std::size_t pairs = 1;   ///< of start and goal in each
  scene::Clutter clutter;  ///< in the map's frame; what it leaves out is kept clear
  PairOptions draw;        ///< `count` is not used; its seed is the first map's
};

/// Random gains for a base scene (example 5.2 of the paper) and its arm's links as segments.
struct GainScenes {
  std::size_t sets = 0;
  std::uint64_t seed = 1;
};

/// A sphere on the path of a problem's arm: the goal becomes a path in joints, and something stands on it.
struct SphereOnPath {
  double radius_m = 0.06;
  std::optional<double> visible_within_m;  ///< the planner sees it once the arm is this near [m]; none: from the start
  double clearance_m = 0.02;               ///< of start and goal from it, at least
  double spacing_rad = 0.1;                ///< of way-points, at most, in the joint that moves most
  std::uint64_t seed = 1;                  ///< which spheres of the arm are tried first
};

/// What a plan is made of: each scene × each planner × each combination of varied values × each seed. Gain sets take
/// the place of varied values where a scene comes from GainScenes.
struct PlanOptions {
  std::vector<std::filesystem::path> files;  ///< problems and scenes, told apart by content
  scene::ProblemOptions problem;             ///< robot, spheres, tip, resolution and mark of maps; `output` is not used
  std::vector<scene::GoalType> goals;        ///< of problems; empty: joint
  std::optional<SphereOnPath> sphere_on_path;  ///< problems take a path for a goal; `goals` is not used
  std::optional<std::filesystem::path> base;   ///< the scene of clutter and gains
  ClutterScenes clutter;
  GainScenes gains;
  std::vector<std::string> planners;  ///< "NAME" or "NAME:key=value,key=value"; empty: the scene's own
  std::vector<std::string> set;       ///< "/json/pointer=VALUE" for all runs
  std::vector<std::string> vary;      ///< "/json/pointer=VALUE,VALUE,…", each combination a run
  std::vector<std::uint64_t> seeds{1};
  std::optional<double> duration_s;
  std::function<void(std::size_t done, std::size_t all)> on_scene;
  std::function<void(const std::string& text)> on_note;  ///< a problem that is left out, and why
  /// Where planners are looked for: each is loaded and asked whether it takes its values; hybrid makes the paths that
  /// spheres are put on.
  std::vector<std::filesystem::path> plugin_directories;
};

/// A gain set of SPEC §4, "Set-up of the measured figures".
struct Gains {
  double k_p = 0.0;            ///< 10^U(−0.5, 1.5) [1/s²]
  double k_v = 0.0;            ///< 2√k_p · 10^U(−0.6, 0.6) [1/s]
  double joint_damping = 0.0;  ///< 0 in half of them, else 10^U(−1.5, 0.5) [Nm s/rad]
  double eta = 0.0;            ///< 10^U(−2, 1.5), for apf [m⁴/s²]
  double k_obs = 0.0;          ///< 10^U(−1, 2), for gyro and hybrid [m/s]
};

/// The first sets do not depend on `count`.
[[nodiscard]] std::vector<Gains> draw_gains(std::size_t count, std::uint64_t seed);

/// Makes the scenes below `directory`/scenes and writes the plan, with the SHA-256 of all that its runs will read. The
/// same options give the same bytes. Holds the lock that run_sweep() holds.
/// @throws Error usage for options that make no sense; io, parse or invalid for what is read; plugin for planners
[[nodiscard]] Plan make_plan(const std::filesystem::path& directory, const PlanOptions& options);

}  // namespace hamelin::sweep

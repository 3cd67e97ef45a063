#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/scene/make.hpp"
#include "hamelin/sweep/pairs.hpp"
#include "hamelin/sweep/plan.hpp"

namespace hamelin::sweep {

/// Random clutter around the arm of a base scene, whose map and obstacles are not used.
struct ClutterScenes {
  std::size_t maps = 0;    ///< number of maps, with consecutive seeds from `clutter.seed`
  std::size_t pairs = 1;   ///< of start and goal per map
  scene::Clutter clutter;  ///< in the map's frame; its keep-out balls stay free
  PairOptions draw;        ///< `count` is not used; the seed is that of the first map
};

/// Random gains for a base scene (example 5.2 of the paper) whose arm has its links as segments.
struct GainScenes {
  std::size_t sets = 0;
  std::uint64_t seed = 1;
};

/// A sphere on the path of a problem's arm: the goal becomes a path in joint space, and the sphere
/// blocks it, or swings across it.
struct SphereOnPath {
  double radius_m = 0.06;
  /// The sphere swings by so much to both sides, at right angles to the way of the part of the arm
  /// that passes there [m]; zero: it stands still.
  double swing_m = 0.0;
  double swing_period_s = 6.0;
  scene::Prediction prediction = scene::Prediction::constant_acceleration;  ///< if it swings
  /// The planner sees the sphere once the arm is this near [m]; none: it knows the sphere from the
  /// start.
  std::optional<double> visible_within_m;
  double clearance_m = 0.02;  ///< of start and goal from the sphere, at least
  double spacing_rad = 0.1;   ///< of waypoints, at most, in the joint that moves most
  std::uint64_t seed = 1;     ///< decides which spheres of the arm are tried first
};

/// Contents of a plan: each scene × each planner × each combination of varied values × each seed.
/// Scenes from GainScenes are also combined with each gain set.
struct PlanOptions {
  std::vector<std::filesystem::path> files;  ///< problems and scenes, distinguished by content
  /// Labels of the runs of scene files, by the names of the files without extension; they replace
  /// those that follow from the file.
  std::map<std::string, std::map<std::string, std::string>> labels;
  scene::ProblemOptions problem;               ///< `output` is not used
  std::vector<scene::GoalType> goals;          ///< of problems; empty: joint
  std::optional<SphereOnPath> sphere_on_path;  ///< problems get a path goal; `goals` is not used
  std::optional<std::filesystem::path> base;   ///< the scene for clutter and gain sets
  ClutterScenes clutter;
  GainScenes gains;
  std::vector<std::string> planners;  ///< "NAME" or "NAME:key=value,…"; empty: the scene's planner
  std::vector<Ablation> ablations;    ///< of `planners`, see add_ablations()
  std::vector<std::string> set;       ///< "/json/pointer=VALUE" for all runs
  std::vector<std::string> vary;      ///< "/json/pointer=VALUE,VALUE,…", one run per combination
  std::vector<std::uint64_t> seeds{1};
  std::optional<double> duration_s;
  std::function<void(std::size_t done, std::size_t all)> on_scene;
  std::function<void(const std::string& text)> on_note;  ///< a problem that is left out, and why
  /// Where planners are searched. Each planner is loaded, and its parameters are checked. hybrid
  /// makes the paths on which spheres are placed.
  std::vector<std::filesystem::path> plugin_directories;
};

/// The kind of goal that problems get: joint, position or pose.
/// @param option what the caller calls it, for messages @throws Error usage for another one
[[nodiscard]] scene::GoalType goal_type_from(std::string_view name, std::string_view option);
/// What is known of a sphere that swings: path, constant-acceleration, constant-velocity or
/// speed-bound. @throws Error usage for another one
[[nodiscard]] scene::Prediction prediction_from(std::string_view name, std::string_view option);

/// A gain set for example 5.2 of the paper. U(a, b) is uniform in [a, b].
struct Gains {
  double k_p = 0.0;            ///< 10^U(−0.5, 1.5) [1/s²]
  double k_v = 0.0;            ///< 2√k_p · 10^U(−0.6, 0.6) [1/s]
  double joint_damping = 0.0;  ///< 0 in half of the sets, else 10^U(−1.5, 0.5) [Nm s/rad]
  double eta = 0.0;            ///< 10^U(−2, 1.5), for apf [m⁴/s²]
  double k_obs = 0.0;          ///< 10^U(−1, 2), for gyro and hybrid [m/s]
};

/// The first sets do not depend on `count`.
[[nodiscard]] std::vector<Gains> draw_gains(std::size_t count, std::uint64_t seed);

/// Writes the scenes to `directory`/scenes and the plan, with the SHA-256 of every file that its
/// runs will read. The same options give the same bytes. Takes the same lock as run_sweep().
/// @throws Error usage for invalid options; io, parse or invalid for input files; plugin for
///         planners
[[nodiscard]] Plan make_plan(const std::filesystem::path& directory, const PlanOptions& options);

}  // namespace hamelin::sweep

#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::app {

/// A scene in which a planner is tried.
struct TrialScene {
  std::string name;
  scene::Scene scene;
  model::Model arm;
};

/// Scenes that need no files: a chain of three links beside a moving ball, with a goal of each
/// kind.
[[nodiscard]] std::vector<TrialScene> built_in_scenes(const planning::Plugin& plugin);

/// A scene file, whatever planner it names. @throws Error for bad input
[[nodiscard]] TrialScene read_trial_scene(const std::filesystem::path& file);

/// The planner's own reason not to start; none if the error is another one.
[[nodiscard]] std::optional<std::string> refusal(const Error& error);

/// What a planner did in a scene.
struct Trial {
  std::string refusal;  ///< the planner's reason not to start; empty: it started
  std::string failure;  ///< why its answers are invalid: one line; empty if they are not
  /// The bytes of all answers, for comparison.
  std::vector<std::uint64_t> answers, answers_after_reset;
  long allocations = 0, allocating_tick = -1;  ///< in ticks; the first tick with one, −1: none
  int threads = 0, threads_left = 0;  ///< that it started; that remain after its destruction
  std::vector<double> tick_s;         ///< wall time of each tick of the planner
  double deadline_s = 0.0;
};

/// Moves a simulated arm by a planner. Meanwhile the goals are replaced, an obstacle appears, moves
/// and disappears, and parameters are set again, if the planner can do that. At the end there is a
/// new start, if it can do that.
/// @throws Error for a scene that does not fit the arm, or if the planner does not start and gives
///   no reason
[[nodiscard]] Trial try_planner(const planning::Plugin& plugin, const Json& params,
                                const TrialScene& scene, int ticks);

}  // namespace hamelin::app

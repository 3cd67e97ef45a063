#pragma once
#include <Eigen/Core>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/log/result.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/simulation/plant.hpp"

namespace hamelin::sweep {

/// Conditions on the start/goal pairs.
struct PairOptions {
  std::size_t count = 60;
  std::uint64_t seed = 1;
  double min_clearance_m = 0.02;  ///< positive; from all that a judge sees at time 0
  double min_distance_rad = 1.5;  ///< ‖goal − start‖, Euclidean over all joints [rad or m]
  std::size_t max_draws = 1'000'000;  ///< configurations drawn before giving up
};

/// A start configuration, at rest, and a joint goal [rad or m].
struct Pair {
  Eigen::VectorXd start, goal;
};

/// Pairs, with the number of draws that they took.
struct DrawnPairs {
  std::vector<Pair> pairs;
  std::size_t draws = 0;        ///< configurations drawn
  std::size_t near_draws = 0;   ///< of `draws`: too near to something, or in self-contact
  std::size_t close_goals = 0;  ///< clear goals nearer than min_distance_rad to their start
};

/// Draws start and goal uniformly within the joint limits, and again until they satisfy the
/// clearance and the distance and, where the scene models it, are free of self-contact. The first k
/// pairs do not depend on `count`.
/// @throws Error invalid if a joint has no limits, or if max_draws do not suffice (the message has
///         the number of pairs found and the reasons of the failures); usage for invalid options;
///         as control::load_model and Environment
[[nodiscard]] DrawnPairs draw_pairs(const scene::Scene& scene, const PairOptions& options);

/// Options for running pairs.
struct PairRuns {
  std::vector<std::filesystem::path> plugin_directories;
  simulation::PlantFactory plant_factory;   ///< see simulation::run
  std::size_t jobs = 1;                     ///< threads; only `timing` in the results depends on it
  const std::atomic<bool>* stop = nullptr;  ///< once set, runs end as interrupted
  /// Called once per run, in the order of the pairs, never concurrently.
  std::function<void(std::size_t index, const log::Result& result)> on_result;
};

/// Runs the scene once per pair, starting at rest, with the pair's goal as the only one. The goal
/// has the tolerances of the scene's first goal if that is a joint goal.
/// @return the results, in the order of the pairs; fewer if stopped
/// @throws Error as simulation::run, and what on_result throws, after the runs in progress have
///         ended; no other run is started
std::vector<log::Result> run_pairs(const scene::Scene& scene, const std::vector<Pair>& pairs,
                                   const PairRuns& runs);

/// Summary of many results. The median of an even number of values is the lower of the two in the
/// middle.
struct Summary {
  std::size_t runs = 0;
  static constexpr std::size_t outcome_count =
      static_cast<std::size_t>(log::Outcome::interrupted) + 1;
  std::array<std::size_t, outcome_count> outcomes{};  ///< by Outcome
  std::optional<double> min_clearance_m;              ///< over all runs
  std::optional<double> certified_share_mean, certified_share_min;
  /// Simulated time of the runs that reached their goal.
  std::optional<double> reached_time_s_median, reached_time_s_max;
  double time_s = 0.0;  ///< simulated, all runs
  /// Over p50 and p99 of the runs.
  std::optional<double> tick_us_p50_median, tick_us_p99_median, tick_us_p99_max;
  double cpu_s = 0.0;

  [[nodiscard]] std::size_t count(log::Outcome outcome) const noexcept {
    return outcomes[static_cast<std::size_t>(outcome)];
  }
};

[[nodiscard]] Summary summarize(const std::vector<log::Result>& results);

/// The summary as JSON: "outcomes" by name, the rest under the names of the members. Values that do
/// not apply are null; values that depend on the clock are under "timing".
[[nodiscard]] Json to_json(const Summary& summary);

}  // namespace hamelin::sweep

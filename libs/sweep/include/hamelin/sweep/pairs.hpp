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

namespace hamelin::sweep {

/// Which start/goal pairs are wanted.
struct PairOptions {
  std::size_t count = 60;
  std::uint64_t seed = 1;
  double min_clearance_m = 0.02;      ///< of start and goal, from all that a judge sees at time 0; positive
  double min_distance_rad = 1.5;      ///< ‖goal − start‖, Euclidean over all joints [rad or m]
  std::size_t max_draws = 1'000'000;  ///< configurations drawn before giving up
};

/// A joint goal and where the arm starts from, at rest [rad or m].
struct Pair {
  Eigen::VectorXd start, goal;
};

/// Pairs, and how hard they were to find.
struct DrawnPairs {
  std::vector<Pair> pairs;
  std::size_t draws = 0;        ///< configurations drawn
  std::size_t near_draws = 0;   ///< of these nearer than min_clearance_m to something, or in self-contact
  std::size_t close_goals = 0;  ///< clear goals that lay within min_distance_rad of their start
};

/// Start and goal uniform in the joint limits, drawn anew until they have their clearance and their distance, and are
/// free of self-contact where the scene models it. The first k pairs do not depend on `count`.
/// @throws Error invalid if a joint has no limits, or if max_draws do not suffice (saying how many were found, and why
///         the rest failed); usage for options that make no sense; all that load_model and Environment throw
[[nodiscard]] DrawnPairs draw_pairs(const scene::Scene& scene, const PairOptions& options);

/// How pairs are run.
struct PairRuns {
  std::vector<std::filesystem::path> plugin_directories;
  std::size_t jobs = 1;                     ///< threads; results do not depend on it, `timing` apart
  const std::atomic<bool>* stop = nullptr;  ///< once set, runs end as interrupted and no other is begun
  /// Called once a run, in the order of the pairs, never at the same time from two threads.
  std::function<void(std::size_t index, const log::Result& result)> on_result;
};

/// Each pair as a run of the scene of its own: its start at rest, its goal as the only one, with the tolerances of the
/// scene's first goal if that is a joint goal.
/// @return the results, in the order of the pairs; fewer if stopped
/// @throws Error as simulation::run does, and what on_result throws, once the runs under way are over; no other is
/// begun
std::vector<log::Result> run_pairs(const scene::Scene& scene, const std::vector<Pair>& pairs, const PairRuns& runs);

/// Many results in a few numbers. A median of an even count is the lower of the two in the middle.
struct Summary {
  std::size_t runs = 0;
  static constexpr std::size_t outcome_count = static_cast<std::size_t>(log::Outcome::interrupted) + 1;
  std::array<std::size_t, outcome_count> outcomes{};  ///< by Outcome
  std::optional<double> min_clearance_m;              ///< over all runs
  std::optional<double> certified_share_mean, certified_share_min;
  std::optional<double> reached_time_s_median, reached_time_s_max;  ///< simulated, of the runs that reached
  double time_s = 0.0;                                              ///< simulated, all runs
  std::optional<double> tick_us_p50_median, tick_us_p99_median, tick_us_p99_max;  ///< of the runs' p50 and p99
  double cpu_s = 0.0;

  [[nodiscard]] std::size_t count(log::Outcome outcome) const noexcept {
    return outcomes[static_cast<std::size_t>(outcome)];
  }
};

[[nodiscard]] Summary summarize(const std::vector<log::Result>& results);

/// The summary as JSON: "outcomes" by name, the rest under the members' names; what does not apply is null, what
/// depends on the clock stands under "timing".
[[nodiscard]] Json to_json(const Summary& summary);

}  // namespace hamelin::sweep

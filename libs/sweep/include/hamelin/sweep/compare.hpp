#pragma once
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/sweep/merge.hpp"
#include "hamelin/sweep/paired_tests.hpp"

namespace hamelin::sweep {

/// Two sides of a study, compared on the runs that both have.
struct Comparison {
  std::string a, b;         ///< directories, or values of a label
  std::size_t pairs = 0;    ///< feasible runs that both sides have recorded
  std::size_t without = 0;  ///< recorded runs without a partner, and pairs that are not feasible
  std::size_t both = 0, only_a = 0, only_b = 0, neither = 0;  ///< of `pairs`: reached the goal
  std::size_t contacts_a = 0, contacts_b = 0;  ///< of `pairs`: runs in which the judge saw contact
  std::size_t other_scenes = 0;                ///< of `pairs`: whose scene files differ
  Interval difference_interval;                ///< of (only_a − only_b) / pairs
  double reached_p = 1.0;                      ///< McNemar's exact test
  /// Arrival times of the pairs that both reach, a − b.
  SignedRank times;
  std::optional<MedianDifference> time_difference_s;

  [[nodiscard]] double difference() const {
    return pairs == 0 ? 0.0
                      : (static_cast<double>(only_a) - static_cast<double>(only_b)) /
                            static_cast<double>(pairs);
  }
};

/// What compared runs have in common.
struct CompareOptions {
  std::string label = "planner";    ///< whose values are compared, within one sweep
  std::vector<std::string> ignore;  ///< labels in which the runs of a pair may differ
};

/// Compares two sweeps. Runs with the same labels and the same name of the scene file are paired.
/// If each sweep has runs of one planner only, they may be of different planners.
/// @throws Error as read_sweeps and read_plan; usage for labels that no run has, and if a sweep has
///         several runs with the same labels apart from the ignored ones
[[nodiscard]] Comparison compare_sweeps(const std::vector<MergedRun>& runs,
                                        const std::filesystem::path& a,
                                        const std::filesystem::path& b,
                                        const CompareOptions& options = {});

/// Compares each two values of a label, in the order of the values. Runs of a pair belong to the
/// same sweep and scene and have the same other labels.
/// @param most comparisons of more values than this are left out
/// @throws Error usage as compare_sweeps
[[nodiscard]] std::vector<Comparison> compare_values(const std::vector<MergedRun>& runs,
                                                     const CompareOptions& options = {},
                                                     std::size_t most = 8);

/// Compares the runs of each planner with those without one of its parts: one entry per ablation,
/// `a` with the part and `b` without it.
/// @throws Error usage as compare_sweeps
[[nodiscard]] std::vector<Comparison> compare_ablations(const Sweeps& sweeps);

/// hamelin.comparison/1
[[nodiscard]] Json to_json(const std::vector<Comparison>& comparisons);
[[nodiscard]] Json to_json(const Comparison& comparison);

/// As text, some lines per comparison.
[[nodiscard]] std::string to_text(const std::vector<Comparison>& comparisons);

}  // namespace hamelin::sweep

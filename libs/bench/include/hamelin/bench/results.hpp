#pragma once
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "hamelin/bench/problem_set.hpp"
#include "hamelin/sweep/compare.hpp"
#include "hamelin/sweep/merge.hpp"

namespace hamelin::bench {

/// Runs of a planner that ended in contact.
struct ContactCounts {
  std::size_t moving = 0;   ///< with an obstacle that moves, while the arm moved
  std::size_t resting = 0;  ///< the same while the arm was at rest: slower than 2 mm/s
  std::size_t other = 0;    ///< with what stands still or the arm itself, or seen by the judge only
  /// How many of them an explanation calls avoidable, avoidable_in_hindsight or unavoidable.
  std::map<std::string, std::size_t> verdicts;
};

/// Where the explanation (hamelin.explanation/1) of a run of a sweep that ended in contact is
/// written, if one is asked for.
[[nodiscard]] std::filesystem::path explanation_file(const std::filesystem::path& directory,
                                                     const std::string& run_id);

/// The results of planners with the problems of a set.
struct Results {
  std::string set_name, set_sha256;
  std::vector<std::string> problems;  ///< names
  std::vector<std::string> planners;  ///< in the order of the plan
  /// Grouped by family and planner; where obstacles move by family, obstacles, speed and planner.
  sweep::Merged by_family;
  std::vector<sweep::Group> by_planner;
  /// With the part and without it, in the order of by_family.sweeps.ablations.
  std::vector<sweep::Comparison> ablations;
  std::map<std::string, ContactCounts> contacts;  ///< by planner; only where obstacles move
};

/// @param directory of a sweep with problems of the set
/// @throws Error as sweep::merge; invalid if it has other problems or other maps
[[nodiscard]] Results read_results(const std::filesystem::path& directory, const ProblemSet& set);

/// As hamelin.benchmark/1, docs/schema/benchmark.schema.json.
[[nodiscard]] Json to_json(const Results& results);

/// Tables: how many problems of each family each planner solves, where obstacles move of each cell,
/// each planner with all problems, contacts where obstacles move, and the ablations if there are
/// any.
/// @param markdown tables of Markdown instead of aligned columns
[[nodiscard]] std::string to_table(const Results& results, bool markdown);

/// Parts without which a planner solves significantly more problems (p < 0.05 by McNemar's exact
/// test): a line for each, that names planner and part.
[[nodiscard]] std::vector<std::string> harmful_parts(const Results& results);

/// Parts that change neither success nor arrival of any problem, as if the planner did not use
/// them: a line for each, that names planner and part. Parts without a problem that both solve are
/// left out.
[[nodiscard]] std::vector<std::string> parts_without_effect(const Results& results);

}  // namespace hamelin::bench

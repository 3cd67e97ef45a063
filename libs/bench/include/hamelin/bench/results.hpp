#pragma once
#include <string>
#include <vector>

#include "hamelin/bench/problem_set.hpp"
#include "hamelin/sweep/compare.hpp"
#include "hamelin/sweep/merge.hpp"

namespace hamelin::bench {

/// The results of planners with the problems of a set.
struct Results {
  std::string set_name, set_sha256;
  std::vector<std::string> problems;  ///< names
  std::vector<std::string> planners;  ///< in the order of the plan
  sweep::Merged by_family;            ///< grouped by family and planner
  std::vector<sweep::Group> by_planner;
  /// With the part and without it, in the order of by_family.sweeps.ablations.
  std::vector<sweep::Comparison> ablations;
};

/// @param directory of a sweep with problems of the set
/// @throws Error as sweep::merge; invalid if it has other problems or other maps
[[nodiscard]] Results read_results(const std::filesystem::path& directory, const ProblemSet& set);

/// As hamelin.benchmark/1, docs/schema/benchmark.schema.json.
[[nodiscard]] Json to_json(const Results& results);

/// Tables: how many problems of each family each planner solves, each planner with all problems,
/// and the ablations if there are any.
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

#pragma once
#include <string>
#include <vector>

#include "hamelin/bench/problem_set.hpp"
#include "hamelin/sweep/merge.hpp"

namespace hamelin::bench {

/// The results of planners with the problems of a set.
struct Results {
  std::string set_name, set_sha256;
  std::vector<std::string> problems;  ///< names
  std::vector<std::string> planners;  ///< in the order of the plan
  sweep::Merged by_family;            ///< grouped by family and planner
  std::vector<sweep::Group> by_planner;
};

/// @param directory of a sweep with problems of the set
/// @throws Error as sweep::merge; invalid if it has other problems or other maps
[[nodiscard]] Results read_results(const std::filesystem::path& directory, const ProblemSet& set);

/// As hamelin.benchmark/1, docs/schema/benchmark.schema.json.
[[nodiscard]] Json to_json(const Results& results);

/// Two tables: how many problems of each family each planner solves, and each planner with all
/// problems.
/// @param markdown tables of Markdown instead of aligned columns
[[nodiscard]] std::string to_table(const Results& results, bool markdown);

}  // namespace hamelin::bench

#include "hamelin/bench/results.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "hamelin/bench/families.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/text_table.hpp"

namespace hamelin::bench {

namespace {

using Row = std::vector<std::string>;

const sweep::Group* find(const std::vector<sweep::Group>& groups, const Row& key) {
  const auto found =
      std::find_if(groups.begin(), groups.end(), [&](const auto& g) { return g.key == key; });
  return found == groups.end() ? nullptr : &*found;
}

std::string shown(const std::optional<double>& value, int digits) {
  return value ? fmt::format("{:.{}f}", *value, digits) : std::string("-");
}

std::string reached(const sweep::Group& g) {
  return g.runs == 0 ? "-" : fmt::format("{}/{}", g.reached, g.feasible);
}

TextTable family_table(const Results& results) {
  TextTable table{{"family"}, {}};
  table.head.insert(table.head.end(), results.planners.begin(), results.planners.end());
  for (const auto& family : families()) {
    Row row{family};
    bool any = false;
    for (const auto& planner : results.planners) {
      const sweep::Group* g = find(results.by_family.groups, {family, planner});
      any = any || g != nullptr;
      row.push_back(g != nullptr ? reached(*g) : "-");
    }
    if (any) table.rows.push_back(std::move(row));
  }
  return table;
}

TextTable planner_table(const Results& results) {
  TextTable table{{"planner", "reached", "%", "95 %", "stalled", "time out", "collided", "other",
                   "contacts", "arrival s", "tick us p50", "p99"},
                  {}};
  for (const auto& planner : results.planners) {
    const sweep::Group& g = *find(results.by_planner, {planner});
    Row row{planner, reached(g),
            g.feasible > 0 ? fmt::format("{:.0f}", 100.0 * static_cast<double>(g.reached) /
                                                       static_cast<double>(g.feasible))
                           : "-",
            fmt::format("{:.0f}-{:.0f}", 100.0 * g.reached_interval.low,
                        100.0 * g.reached_interval.high)};
    for (const std::size_t runs : sweep::failures_by_end(g)) row.push_back(fmt::format("{}", runs));
    row.push_back(fmt::format("{}", g.contacts));
    row.push_back(shown(g.reached_time_s_median, 2));
    row.push_back(shown(g.tick_us_p50_median, 1));
    row.push_back(shown(g.tick_us_p99_median, 1));
    table.rows.push_back(std::move(row));
  }
  return table;
}

// The problems of the set that the plan has.
std::vector<Problem> planned_problems(const sweep::Plan& plan, const ProblemSet& set,
                                      const std::string& where) {
  std::set<std::string> names;
  for (const auto& run : plan.runs) names.insert(run.labels.at("problem"));
  std::vector<Problem> problems;
  for (const auto& problem : set.problems)
    if (names.erase(problem.name) > 0) problems.push_back(problem);
  if (!names.empty())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: problem '{}' is not in the set {}, expected a plan of that set",
                            where, *names.begin(), set.name));
  return problems;
}

}  // namespace

Results read_results(const std::filesystem::path& directory, const ProblemSet& set) {
  Results results{set.name,
                  set.sha256,
                  {},
                  {},
                  sweep::merge(sweep::read_sweeps({directory}), {"family", "planner"}),
                  {}};
  for (const auto& run : results.by_family.sweeps.runs) {
    const std::string& planner = run.run.labels.at("planner");
    if (std::find(results.planners.begin(), results.planners.end(), planner) ==
        results.planners.end())
      results.planners.push_back(planner);
  }
  results.by_planner = sweep::group(results.by_family.sweeps.runs, {"planner"});
  const sweep::Plan plan = sweep::read_plan(directory);
  const auto problems = planned_problems(plan, set, sweep::plan_file(directory).string());
  check_maps(problems, plan, sweep::plan_file(directory).string());
  for (const auto& problem : problems) results.problems.push_back(problem.name);
  return results;
}

Json to_json(const Results& results) {
  return {{"schema", "hamelin.benchmark/1"},
          {"set", {{"name", results.set_name}, {"sha256", results.set_sha256}}},
          {"problems", results.problems},
          {"planners", results.planners},
          {"machine", results.by_family.sweeps.machine},
          {"summary", sweep::to_json(results.by_family)}};
}

std::string to_table(const Results& results, bool markdown) {
  const auto text = [markdown](const TextTable& table) {
    return markdown ? to_markdown(table) : hamelin::to_text(table);
  };
  return text(family_table(results)) + "\n" + text(planner_table(results));
}

}  // namespace hamelin::bench

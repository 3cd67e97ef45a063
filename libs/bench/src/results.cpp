#include "hamelin/bench/results.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "hamelin/bench/families.hpp"
#include "hamelin/bench/moving.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/text_table.hpp"
#include "hamelin/sweep/ablation.hpp"
#include "moving_results.hpp"

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

// "-1.2 to +3.4", of an interval that is multiplied by `scale`.
std::string shown(const sweep::Interval& interval, double scale, int digits) {
  return fmt::format("{:+.{}f} to {:+.{}f}", scale * interval.low, digits, scale * interval.high,
                     digits);
}

TextTable ablation_table(const Results& results) {
  TextTable table{
      {"ablation of", "part", "with", "without", "only with", "only without", "p", "difference %",
       "95 %", "contacts with", "contacts without", "later by s", "95 % s"},
      {},
      2};
  for (std::size_t i = 0; i < results.ablations.size(); ++i) {
    const sweep::Ablation& ablation = results.by_family.sweeps.ablations[i];
    const sweep::Comparison& c = results.ablations[i];
    const auto& time = c.time_difference_s;
    table.rows.push_back(
        {ablation.planner, sweep::part_of(ablation),
         fmt::format("{}/{}", c.both + c.only_a, c.pairs),
         fmt::format("{}/{}", c.both + c.only_b, c.pairs), fmt::format("{}", c.only_a),
         fmt::format("{}", c.only_b), fmt::format("{:.2g}", c.reached_p),
         fmt::format("{:+.1f}", 100.0 * c.difference()), shown(c.difference_interval, 100.0, 1),
         fmt::format("{}", c.contacts_a), fmt::format("{}", c.contacts_b),
         time ? fmt::format("{:+.2f}", time->estimate) : "-",
         time && time->interval ? shown(*time->interval, 1.0, 2) : "-"});
  }
  return table;
}

Json ablation_json(const sweep::Ablation& ablation, const sweep::Comparison& c) {
  const auto interval = [](const sweep::Interval& i) { return Json::array({i.low, i.high}); };
  const auto& time = c.time_difference_s;
  return {{"planner", ablation.planner},
          {"without", ablation.without},
          {"parameter", ablation.parameter},
          {"value", ablation.value},
          {"pairs", c.pairs},
          {"left_out", c.without},
          {"reached",
           {{"with", c.both + c.only_a},
            {"without", c.both + c.only_b},
            {"only_with", c.only_a},
            {"only_without", c.only_b},
            {"difference", c.difference()},
            {"difference_interval", interval(c.difference_interval)},
            {"p", c.reached_p}}},
          {"contacts", {{"with", c.contacts_a}, {"without", c.contacts_b}}},
          {"arrival",
           {{"pairs", c.both},
            {"difference_s", time ? Json(time->estimate) : Json(nullptr)},
            {"difference_interval_s",
             time && time->interval ? interval(*time->interval) : Json(nullptr)},
            {"p", c.times.used > 0 ? Json(c.times.p) : Json(nullptr)}}}};
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
  const bool moving = is_moving(set.problems.front().family);
  sweep::Sweeps sweeps = sweep::read_sweeps({directory});
  std::vector<std::string> by{"family", "planner"};
  if (moving) {
    name_predictions(sweeps);
    by = {"family", obstacles_label, speed_label, "planner"};
  }
  Results results{set.name, set.sha256, {}, {}, sweep::merge(std::move(sweeps), by), {}, {}, {}};
  if (moving) results.contacts = count_contacts(results.by_family.sweeps, directory);
  for (const auto& run : results.by_family.sweeps.runs) {
    const std::string& planner = run.run.labels.at("planner");
    if (std::find(results.planners.begin(), results.planners.end(), planner) ==
        results.planners.end())
      results.planners.push_back(planner);
  }
  results.by_planner = sweep::group(results.by_family.sweeps.runs, {"planner"});
  results.ablations = sweep::compare_ablations(results.by_family.sweeps);
  const sweep::Plan plan = sweep::read_plan(directory);
  const auto problems = planned_problems(plan, set, sweep::plan_file(directory).string());
  if (!moving) check_maps(problems, plan, sweep::plan_file(directory).string());
  for (const auto& problem : problems) results.problems.push_back(problem.name);
  return results;
}

Json to_json(const Results& results) {
  Json ablations = Json::array();
  for (std::size_t i = 0; i < results.ablations.size(); ++i)
    ablations.push_back(ablation_json(results.by_family.sweeps.ablations[i], results.ablations[i]));
  Json document{{"schema", "hamelin.benchmark/1"},
                {"set", {{"name", results.set_name}, {"sha256", results.set_sha256}}},
                {"problems", results.problems},
                {"planners", results.planners},
                {"machine", results.by_family.sweeps.machine},
                {"summary", sweep::to_json(results.by_family)},
                {"ablations", std::move(ablations)}};
  if (!results.contacts.empty()) document["contacts"] = contacts_json(results);
  return document;
}

std::string to_table(const Results& results, bool markdown) {
  const auto text = [markdown](const TextTable& table) {
    return markdown ? to_markdown(table) : hamelin::to_text(table);
  };
  const bool moving = !results.contacts.empty();
  std::string all = text(moving ? cell_table(results) : family_table(results)) + "\n" +
                    text(planner_table(results));
  if (moving) all += "\n" + text(contact_table(results));
  if (!results.ablations.empty()) all += "\n" + text(ablation_table(results));
  return all;
}

std::vector<std::string> harmful_parts(const Results& results) {
  constexpr double level = 0.05;
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < results.ablations.size(); ++i) {
    const sweep::Comparison& c = results.ablations[i];
    if (c.only_b <= c.only_a || c.reached_p >= level) continue;
    lines.push_back(fmt::format(
        "{}: reaches {} of {} goals, and {} with {} (McNemar p = {:.2g}), expected no part to "
        "reduce success",
        c.a, c.both + c.only_a, c.pairs, c.both + c.only_b,
        sweep::part_of(results.by_family.sweeps.ablations[i]), c.reached_p));
  }
  return lines;
}

std::vector<std::string> parts_without_effect(const Results& results) {
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < results.ablations.size(); ++i) {
    const sweep::Comparison& c = results.ablations[i];
    if (c.both == 0 || c.only_a + c.only_b + c.times.used > 0) continue;
    lines.push_back(fmt::format("{}: {} changes neither success nor arrival of any of {} problems",
                                c.a, sweep::part_of(results.by_family.sweeps.ablations[i]),
                                c.pairs));
  }
  return lines;
}

}  // namespace hamelin::bench

#include "hamelin/sweep/merge.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "hamelin/core/error.hpp"
#include "hamelin/io/text_table.hpp"
#include "statistics.hpp"

namespace hamelin::sweep {

namespace {

/// Values that a group collects before they are summarized.
struct GroupData {
  Group group;
  std::vector<double> torque_changes, clearances, self_clearances, shares, times, p50, p99,
      recovery, filter;
};

void append(std::vector<double>& values, const std::optional<double>& value) {
  if (value) values.push_back(*value);
}

void add_run(GroupData& data, const MergedRun& merged) {
  Group& g = data.group;
  ++g.planned;
  const RunFacts& facts = merged.facts;
  if (!facts.recorded) return;
  ++g.runs;
  ++g.outcomes[facts.outcome];
  g.feasible += merged.feasible ? 1U : 0U;
  g.reached += merged.feasible && facts.success ? 1U : 0U;
  g.reached_all += facts.success ? 1U : 0U;
  g.contacts += facts.judge_saw_contact ? 1U : 0U;
  g.judged += facts.judged ? 1U : 0U;
  if (facts.plant_contacts) {
    ++g.plant_runs;
    g.plant_contacts += *facts.plant_contacts > 0.0 ? 1U : 0U;
  }
  append(data.clearances, facts.clearance_m);
  append(data.self_clearances, facts.self_clearance_m);
  append(data.shares, facts.certified_share);
  append(data.torque_changes, facts.torque_change_mean);
  append(data.recovery, facts.recovery_work_J);
  append(data.filter, facts.filter_work_J);
  append(data.p50, facts.tick_us_p50);
  append(data.p99, facts.tick_us_p99);
  for (const auto& [name, value] : facts.escape) g.escapes[name] += value;
  if (facts.success)
    append(data.times, facts.time_s);
  else
    ++g.causes[facts.failure];
}

Group make_group(GroupData&& data) {
  Group g = std::move(data.group);
  g.reached_interval = wilson_interval(g.reached, g.feasible);
  g.min_clearance_m = smallest(data.clearances);
  g.min_self_clearance_m = smallest(data.self_clearances);
  g.certified_share_mean = mean(data.shares);
  g.certified_share_min = smallest(data.shares);
  g.reached_time_s_median = median(data.times);
  g.torque_change_mean = mean(data.torque_changes);
  g.tick_us_p50_median = median(data.p50);
  g.tick_us_p99_median = median(data.p99);
  g.filter_work_J_max = largest(data.filter).value_or(0.0);
  g.recovery_work_J_median = median(data.recovery);
  return g;
}

}  // namespace

// docs/theory.md (13.13)
Interval wilson_interval(std::size_t successes, std::size_t trials) {
  if (trials == 0) return {};
  constexpr double z = 1.959963984540054;
  const double n = static_cast<double>(trials), p = static_cast<double>(successes) / n, z2 = z * z;
  const double center = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
  const double half = z / (1.0 + z2 / n) * std::sqrt(p * (1.0 - p) / n + z2 / (4.0 * n * n));
  return {successes == 0 ? 0.0 : center - half, successes == trials ? 1.0 : center + half};
}

std::vector<Group> group(const std::vector<MergedRun>& runs, const std::vector<std::string>& by) {
  for (const auto& label : by) {
    const bool known = std::any_of(
        runs.begin(), runs.end(), [&](const MergedRun& r) { return r.run.labels.contains(label); });
    if (known || runs.empty()) continue;
    std::vector<std::string> names;
    for (const auto& [name, value] : runs.front().run.labels) names.push_back(name);
    throw Error(ErrorCode::usage, fmt::format("--by {}: no run has that label, expected one of {}",
                                              label, fmt::join(names, ", ")));
  }
  std::map<std::vector<std::string>, GroupData> all;
  for (const auto& merged : runs) {
    std::vector<std::string> key;
    for (const auto& label : by) {
      const auto found = merged.run.labels.find(label);
      key.push_back(found == merged.run.labels.end() ? "" : found->second);
    }
    GroupData& data = all[key];
    data.group.key = key;
    add_run(data, merged);
  }
  std::vector<Group> groups;
  groups.reserve(all.size());
  for (auto& [key, data] : all) groups.push_back(make_group(std::move(data)));
  return groups;
}

std::vector<GainGroup> group_gains(const std::vector<MergedRun>& runs) {
  const auto set_of = [](const MergedRun& r) {
    return std::vector{r.directory.string(), r.run.labels.at("gains"), r.run.labels.at("seed"),
                       r.run.labels.contains("values") ? r.run.labels.at("values") : std::string()};
  };
  const auto is_reference = [](const MergedRun& r) {
    return r.run.labels.at("problem") == no_obstacle;
  };
  std::set<std::vector<std::string>> references, stalled;
  for (const auto& r : runs) {
    if (r.run.gains.empty() || !r.facts.recorded) continue;
    if (is_reference(r)) {
      if (r.facts.outcome == "reached") references.insert(set_of(r));
    } else if (r.run.labels.at("planner") == "apf" && r.facts.outcome == "stalled") {
      stalled.insert(set_of(r));
    }
  }
  std::map<std::string, GainGroup> groups;
  for (const auto& r : runs) {
    if (r.run.gains.empty() || !r.facts.recorded || is_reference(r)) continue;
    GainGroup& g = groups[r.run.labels.at("planner")];
    g.planner = r.run.labels.at("planner");
    const bool reached = r.facts.outcome == "reached", reference = references.contains(set_of(r)),
               apf_stalled = stalled.contains(set_of(r));
    ++g.sets;
    g.reached += reached ? 1U : 0U;
    g.contacts += r.facts.judge_saw_contact ? 1U : 0U;
    g.reference += reference ? 1U : 0U;
    g.reached_of_reference += reference && reached ? 1U : 0U;
    g.apf_stalled += apf_stalled ? 1U : 0U;
    g.reached_of_apf_stalled += apf_stalled && reached ? 1U : 0U;
  }
  std::vector<GainGroup> all;
  all.reserve(groups.size());
  for (auto& [planner, g] : groups) {
    g.interval = wilson_interval(g.reached_of_reference, g.reference);
    all.push_back(std::move(g));
  }
  return all;
}

std::array<std::size_t, 4> failures_by_end(const Group& g) {
  const auto count = [&](const char* outcome) {
    const auto found = g.outcomes.find(outcome);
    return found == g.outcomes.end() ? std::size_t{0} : found->second;
  };
  const std::size_t stalled = count("stalled"), timeout = count("timeout"),
                    collided = count("collision");
  return {stalled, timeout, collided, g.runs - g.reached_all - stalled - timeout - collided};
}

Merged merge(Sweeps&& sweeps, const std::vector<std::string>& by) {
  Merged merged{std::move(sweeps), by, {}, {}, {}};
  const Sweeps& from = merged.sweeps;
  merged.groups = group(from.runs, by);
  merged.gains = group_gains(from.runs);
  const auto missing = std::count_if(from.runs.begin(), from.runs.end(),
                                     [](const MergedRun& r) { return !r.facts.recorded; });
  if (missing > 0)
    merged.notes.push_back(
        fmt::format("{} of {} runs have no record yet", missing, from.runs.size()));
  for (const auto& [name, all] : from.builds)
    if (all.size() > 1)
      merged.notes.push_back(
          fmt::format("the records come from {} builds of {}", all.size(), name));
  if (!from.different.empty())
    merged.notes.push_back(fmt::format(
        "{} runs have different records in several files, the first of them is '{}'; the first "
        "record of each is used",
        from.different.size(), from.different.front()));
  return merged;
}

Json to_json(const Merged& merged) {
  Json all = Json::array(), gains = Json::array();
  for (const auto& g : merged.groups) {
    Json labels = Json::object(), outcomes = Json::object(), causes = Json::object(),
         escapes = Json::object();
    for (std::size_t i = 0; i < merged.by.size(); ++i) labels[merged.by[i]] = g.key[i];
    for (const auto& [name, count] : g.outcomes) outcomes[name] = count;
    for (const auto& [name, count] : g.causes) causes[name] = count;
    for (const auto& [name, sum] : g.escapes) escapes[name] = sum;
    all.push_back({{"labels", std::move(labels)},
                   {"planned", g.planned},
                   {"runs", g.runs},
                   {"feasible", g.feasible},
                   {"reached", g.reached},
                   {"reached_all", g.reached_all},
                   {"reached_share_interval", {g.reached_interval.low, g.reached_interval.high}},
                   {"outcomes", std::move(outcomes)},
                   {"judged", g.judged},
                   {"contacts", g.contacts},
                   {"min_clearance_m", or_null(g.min_clearance_m)},
                   {"min_self_clearance_m", or_null(g.min_self_clearance_m)},
                   {"certified_share_mean", or_null(g.certified_share_mean)},
                   {"certified_share_min", or_null(g.certified_share_min)},
                   {"reached_time_s_median", or_null(g.reached_time_s_median)},
                   {"torque_change_mean", or_null(g.torque_change_mean)},
                   {"filter_work_J_max", g.filter_work_J_max},
                   {"recovery_work_J_median", or_null(g.recovery_work_J_median)},
                   {"escapes", g.escapes.empty() ? Json(nullptr) : std::move(escapes)},
                   {"causes", std::move(causes)},
                   {"timing",
                    {{"tick_us_p50_median", or_null(g.tick_us_p50_median)},
                     {"tick_us_p99_median", or_null(g.tick_us_p99_median)}}}});
    if (g.plant_runs > 0) {
      all.back()["plant_runs"] = g.plant_runs;
      all.back()["plant_contacts"] = g.plant_contacts;
    }
  }
  for (const auto& g : merged.gains)
    gains.push_back({{"planner", g.planner},
                     {"sets", g.sets},
                     {"reached", g.reached},
                     {"contacts", g.contacts},
                     {"reference", g.reference},
                     {"reached_of_reference", g.reached_of_reference},
                     {"reached_share_interval", {g.interval.low, g.interval.high}},
                     {"apf_stalled", g.apf_stalled},
                     {"reached_of_apf_stalled", g.reached_of_apf_stalled}});
  return {{"schema", "hamelin.summary/1"},
          {"by", merged.by},
          {"groups", std::move(all)},
          {"gains", std::move(gains)},
          {"notes", merged.notes}};
}

namespace {

std::vector<std::string> table_row(const Group& g) {
  const auto shown = [](const std::optional<double>& value, double scale, int digits) {
    return value ? fmt::format("{:.{}f}", scale * *value, digits) : std::string("-");
  };
  std::vector<std::string> row = g.key;
  row.push_back(g.runs == g.planned ? fmt::format("{}", g.runs)
                                    : fmt::format("{}/{}", g.runs, g.planned));
  row.push_back(fmt::format("{}", g.feasible));
  row.push_back(g.feasible > 0 ? fmt::format("{} ({:.1f} %)", g.reached,
                                             100.0 * static_cast<double>(g.reached) /
                                                 static_cast<double>(g.feasible))
                               : "-");
  row.push_back(g.feasible > 0 ? fmt::format("{:.0f}-{:.0f}", 100.0 * g.reached_interval.low,
                                             100.0 * g.reached_interval.high)
                               : "-");
  for (const std::size_t runs : failures_by_end(g)) row.push_back(fmt::format("{}", runs));
  row.push_back(fmt::format("{}", g.contacts));
  row.push_back(shown(g.min_clearance_m, 1e3, 2));
  row.push_back(shown(g.min_self_clearance_m, 1e3, 2));
  row.push_back(shown(g.certified_share_mean, 100.0, 3));
  row.push_back(shown(g.certified_share_min, 100.0, 2));
  row.push_back(shown(g.reached_time_s_median, 1.0, 2));
  row.push_back(shown(g.torque_change_mean, 1.0, 3));
  row.push_back(shown(g.tick_us_p50_median, 1.0, 1));
  row.push_back(shown(g.tick_us_p99_median, 1.0, 1));
  return row;
}

std::string causes_text(const Group& g) {
  std::string text =
      fmt::format("\n{}: runs that did not reach the goal\n", fmt::join(g.key, ", "));
  std::vector<std::pair<std::string, std::size_t>> causes(g.causes.begin(), g.causes.end());
  std::stable_sort(causes.begin(), causes.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  for (const auto& [cause, count] : causes) text += fmt::format("{:>5}  {}\n", count, cause);
  return text;
}

}  // namespace

std::string to_table(const Merged& merged) {
  TextTable table{merged.by, {}, merged.by.size()};
  for (const char* head :
       {"runs", "feas.", "reached", "95 %", "stall", "time", "coll.", "other", "contacts", "min mm",
        "self mm", "cert. % mean", "min", "arrive s", "dtau", "tick us p50", "p99"})
    table.head.emplace_back(head);
  for (const auto& g : merged.groups) table.rows.push_back(table_row(g));
  std::string text = to_text(table);
  for (const auto& g : merged.groups)
    if (g.plant_runs > 0)
      text +=
          fmt::format("\n{}: the plant's own collision detection counted contact in {} of {} runs",
                      fmt::join(g.key, ", "), g.plant_contacts, g.plant_runs);
  if (std::any_of(merged.groups.begin(), merged.groups.end(),
                  [](const Group& g) { return g.plant_runs > 0; }))
    text += "\n";
  for (const auto& g : merged.gains)
    text += fmt::format(
        "\n{}, gain sets: reached {} of {}; {} of {} that reach the goal without the obstacle "
        "({:.1f}-{:.1f} %); "
        "{} of {} with which apf stalls; {} contacts",
        g.planner, g.reached, g.sets, g.reached_of_reference, g.reference, 100.0 * g.interval.low,
        100.0 * g.interval.high, g.reached_of_apf_stalled, g.apf_stalled, g.contacts);
  if (!merged.gains.empty()) text += "\n";
  for (const auto& g : merged.groups)
    if (!g.causes.empty()) text += causes_text(g);
  return text;
}

}  // namespace hamelin::sweep

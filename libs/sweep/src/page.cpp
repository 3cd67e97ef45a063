#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "hamelin/sweep/merge.hpp"
#include "shell.hpp"

namespace hamelin::sweep {

namespace {

std::string command_of(const MergedRun& merged) {
  std::string command = "hamelin run";
  for (const auto& word : run_arguments(merged.run, merged.directory))
    command += fmt::format(" {}", shell_word(word));
  return command;
}

/// Why a run did not reach its goal: its own cause, contact that the judge saw, and infeasibility.
std::string cause_of(const MergedRun& merged) {
  const Json& record = merged.record;
  std::string cause = record["cause"].is_string() ? record["cause"].get<std::string>() : "";
  const auto add = [&cause](const std::string& text) {
    cause += fmt::format("{}{}", cause.empty() ? "" : "; ", text);
  };
  for (const char* kind : {"obstacles", "self"}) {
    const Json closest = record["judge"].is_object() ? record["judge"].at(kind) : Json();
    if (closest.is_object() && closest.value("clearance_m", 1.0) <= 0.0)
      add(fmt::format("the judge saw {} touch {} at {:.3f} s", closest.value("sphere", "?"),
                      closest.value("other", "?"), closest.value("time_s", 0.0)));
  }
  if (!merged.feasible) add(fmt::format("not feasible ({})", merged.reason));
  return cause;
}

Json failures(const Merged& merged) {
  Json all = Json::array();
  for (const auto& r : merged.sweeps.runs)
    if (!r.record.is_null() && r.record["outcome"] != "reached")
      all.push_back({{"run", r.run.id},
                     {"outcome", r.record["outcome"]},
                     {"cause", cause_of(r)},
                     {"command", command_of(r)}});
  return all;
}

Json gain_sets(const Merged& merged) {
  Json all = Json::array();
  for (const auto& r : merged.sweeps.runs) {
    if (r.run.gains.empty() || r.record.is_null() || r.run.labels.at("problem") == no_obstacle)
      continue;
    Json gains = Json::object();
    for (const auto& [name, value] : r.run.gains) gains[name] = value;
    all.push_back({{"planner", r.run.labels.at("planner")},
                   {"run", r.run.id},
                   {"outcome", r.record["outcome"]},
                   {"cause", r.record["cause"]},
                   {"gains", std::move(gains)}});
  }
  return all;
}

}  // namespace

Json page_json(const Merged& merged) {
  std::set<std::string> directories;
  for (const auto& r : merged.sweeps.runs) directories.insert(r.directory.string());
  const auto recorded = std::count_if(merged.sweeps.runs.begin(), merged.sweeps.runs.end(),
                                      [](const MergedRun& r) { return !r.record.is_null(); });
  return {{"format", "hamelin.sweep-page/1"},
          {"generator", fmt::format("hamelin {}", version())},
          {"directories", directories},
          {"planned", merged.sweeps.runs.size()},
          {"recorded", recorded},
          {"summary", to_json(merged)},
          {"gain_sets", gain_sets(merged)},
          {"failures", failures(merged)}};
}

}  // namespace hamelin::sweep

#include "plugin_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <initializer_list>
#include <utility>

#include "child_process.hpp"
#include "empty_host.hpp"
#include "hamelin/core/allocation_count.hpp"
#include "hamelin/core/error.hpp"
#include "plugin_trial.hpp"

namespace hamelin::app {

namespace {

constexpr int trial_ticks = 300;

/// The list of checks, in the order in which they are printed.
class Checks {
 public:
  void add(std::string name, std::string failure) {
    const auto outcome = failure.empty() ? PluginCheck::Outcome::ok : PluginCheck::Outcome::failed;
    all_.push_back({outcome, std::move(name), std::move(failure)});
  }
  void skip(std::string name, std::string reason) {
    all_.push_back({PluginCheck::Outcome::skipped, std::move(name), std::move(reason)});
  }
  void remark(std::string text) { all_.back().text = std::move(text); }
  [[nodiscard]] std::vector<PluginCheck> take() { return std::move(all_); }

 private:
  std::vector<PluginCheck> all_;
};

// ---- parameters

const Json& properties_of(const planning::Plugin& plugin) {
  static const Json none = Json::object();
  const auto at = plugin.params_schema().find("properties");
  return at == plugin.params_schema().end() ? none : *at;
}

std::string undescribed(const planning::Plugin& plugin) {
  const auto has_any = [](const Json& rule, std::initializer_list<const char*> keys) {
    return std::any_of(keys.begin(), keys.end(), [&](const char* k) { return rule.contains(k); });
  };
  for (const auto& [key, rule] : properties_of(plugin).items()) {
    for (const char* what : {"description", "default"})
      if (!rule.contains(what))
        return fmt::format("'{}' has no {}, expected one for each parameter", key, what);
    if (!has_any(rule, {"type", "enum", "const", "$ref", "allOf", "anyOf", "oneOf"}))
      return fmt::format("'{}' accepts any value, expected a type or a list of values", key);
  }
  return "";
}

// The values at the ends of a parameter's range.
std::vector<Json> extremes(const Json& rule) {
  std::vector<Json> values;
  for (const char* end : {"minimum", "maximum"})
    if (rule.contains(end)) values.push_back(rule[end]);
  if (rule.contains("enum"))
    for (const auto& value : rule["enum"]) values.push_back(value);
  if (rule.value("type", Json()) == "boolean") values.insert(values.end(), {true, false});
  return values;
}

std::string answers_or_refuses(const planning::Plugin& plugin, const Json& params) {
  EmptyHost host;
  try {
    answer_ticks(plugin, params, host);
  } catch (const Error& e) {
    if (!refusal(e)) return e.what();
  }
  return "";
}

std::string fails_at_extremes(const planning::Plugin& plugin, double timeout_s) {
  for (const auto& [key, rule] : properties_of(plugin).items())
    for (const Json& value : extremes(rule)) {
      const Json given{{key, value}};
      const std::string failure = run_in_child(
          [&] { return answers_or_refuses(plugin, planning::check_params(plugin, given)); },
          timeout_s);
      if (!failure.empty())
        return fmt::format("'{}' = {}: {}, expected valid answers or a reason why it cannot start",
                           key, value.dump(), failure);
    }
  return "";
}

// ---- trials

/// What is wrong with a planner by its trials in several scenes; empty: nothing.
struct Findings {
  std::string allocation, threads, repetition, restart, lateness;
  double slowest_share = 0.0;  ///< of the deadline
  std::string slowest;         ///< "12 us of 1000 us in shelf.json"; empty: it ran in no scene
};

std::string excess_threads(const planning::Plugin& plugin, const Trial& trial) {
  if (trial.threads > 0 && !plugin.uses_threads())
    return fmt::format("it started {} threads, expected none without HAMELIN_USES_THREADS",
                       trial.threads);
  if (trial.threads_left > 0)
    return fmt::format("{} threads run on after its destruction, expected none",
                       trial.threads_left);
  return "";
}

std::string excess_allocations(const planning::Plugin& plugin, const Trial& trial) {
  if (trial.allocations == 0 || plugin.tick_allocates()) return "";
  return fmt::format(
      "{} allocations, the first in tick {}, expected none without HAMELIN_TICK_ALLOCATES",
      trial.allocations, trial.allocating_tick);
}

bool repeats_after_reset(const Trial& trial) {
  const auto &first = trial.answers, &again = trial.answers_after_reset;
  return again.size() <= first.size() && std::equal(again.begin(), again.end(), first.begin());
}

// The time that 99 % of the ticks take at most, if both runs do the same work in a tick: other
// programs on the machine seldom delay the same tick of both.
double p99(const std::vector<double>& first, const std::vector<double>& second) {
  std::vector<double> best(std::min(first.size(), second.size()));
  if (best.empty()) return 0.0;
  for (std::size_t i = 0; i < best.size(); ++i) best[i] = std::min(first[i], second[i]);
  std::sort(best.begin(), best.end());
  return best[best.size() * 99 / 100];
}

// Everything that two runs in a scene reveal, as an object of findings.
Json examine(const planning::Plugin& plugin, const Json& params, const TrialScene& scene,
             std::optional<double> deadline_s) {
  const Trial first = try_planner(plugin, params, scene, trial_ticks);
  if (!first.refusal.empty()) return {{"refusal", first.refusal}};
  if (!first.failure.empty()) return {{"failure", first.failure}};
  const Trial second = try_planner(plugin, params, scene, trial_ticks);
  Json out{{"p99_s", p99(first.tick_s, second.tick_s)},
           {"deadline_s", deadline_s.value_or(first.deadline_s)},
           {"allocation", excess_allocations(plugin, first)},
           {"threads", excess_threads(plugin, first)}};
  if (plugin.uses_threads()) return out;  // the order of their work is not determined
  if (second.answers != first.answers)
    out["repetition"] = "two runs with the same seed gave different answers, expected equal ones";
  if (!repeats_after_reset(first))
    out["restart"] = "the answers after reset differ from those of the first start, expected equal";
  return out;
}

void add_findings(Findings& findings, const Json& found, const std::string& scene) {
  const auto keep_first = [&](std::string& finding, const std::string& text) {
    if (finding.empty() && !text.empty()) finding = fmt::format("{}: {}", scene, text);
  };
  const auto text = [&](const char* key) { return found.value(key, std::string()); };
  keep_first(findings.allocation, text("allocation"));
  keep_first(findings.threads, text("threads"));
  keep_first(findings.repetition, text("repetition"));
  keep_first(findings.restart, text("restart"));
  const double p99_s = found["p99_s"], deadline_s = found["deadline_s"];
  if (p99_s > deadline_s)
    keep_first(findings.lateness,
               fmt::format("99 % of its ticks take up to {:.0f} us, expected at most {:.0f} us",
                           1e6 * p99_s, 1e6 * deadline_s));
  if (findings.slowest.empty() || p99_s / deadline_s > findings.slowest_share) {
    findings.slowest_share = p99_s / deadline_s;
    findings.slowest = fmt::format("99 % take at most {:.0f} us of {:.0f} us ({})", 1e6 * p99_s,
                                   1e6 * deadline_s, scene);
  }
}

// Tries the planner in a process of its own.
void check_scene(Checks& checks, const planning::Plugin& plugin, const Json& params,
                 const TrialScene& scene, const PluginCheckOptions& options, Findings& findings) {
  const std::string name = fmt::format("valid answers in the scene '{}'", scene.name);
  const std::string text = run_in_child(
      [&] { return examine(plugin, params, scene, options.deadline_s).dump(); }, options.timeout_s);
  const Json found = try_parse_json(text);
  if (!found.is_object()) {  // it crashed, or hangs
    checks.add(name, fmt::format("{}, expected answers", text));
  } else if (found.contains("refusal")) {
    checks.skip(name, "the planner refuses to start: " + found["refusal"].get<std::string>());
  } else {
    checks.add(name, found.value("failure", ""));
    if (!found.contains("failure")) add_findings(findings, found, scene.name);
  }
}

std::vector<TrialScene> trial_scenes(const planning::Plugin& plugin, const Json& params,
                                     const std::vector<std::filesystem::path>& files) {
  std::vector<TrialScene> scenes = built_in_scenes(plugin);
  for (const auto& file : files) {
    scenes.push_back(read_trial_scene(file));
    scenes.back().scene.planner = scene::Choice{plugin.name(), params};
  }
  return scenes;
}

void check_behaviour(Checks& checks, const planning::Plugin& plugin, const Findings& findings) {
  if (findings.slowest.empty()) {
    checks.add("it runs in at least one scene", "it ran in none, expected one");
    return;
  }
  const std::string no_memory = "ticks do not allocate";
  if (plugin.tick_allocates())
    checks.skip(no_memory, "it declares HAMELIN_TICK_ALLOCATES");
  else if (!counts_allocations())
    checks.skip(no_memory, "this build does not count allocations");
  else
    checks.add(no_memory, findings.allocation);
  checks.add(plugin.uses_threads() ? "its threads end with the planner" : "it starts no threads",
             findings.threads);
  const std::string threaded = "it declares HAMELIN_USES_THREADS";
  const std::string equal = "equal runs give equal answers", restart = "a reset repeats the run";
  if (plugin.uses_threads())
    checks.skip(equal, threaded);
  else
    checks.add(equal, findings.repetition);
  if (!plugin.can_reset())
    checks.skip(restart, "it has no function reset");
  else if (plugin.uses_threads())
    checks.skip(restart, threaded);
  else
    checks.add(restart, findings.restart);
  checks.add("ticks end before the deadline", findings.lateness);
  if (findings.lateness.empty()) checks.remark(findings.slowest);
}

std::string open_queries(const planning::Plugin& plugin, const Json& params) {
  EmptyHost host;
  try {
    answer_ticks(plugin, params, host);
  } catch (const Error&) {
    // Other checks report it; what it opened must be closed all the same.
  }
  if (host.open_queries() == 0) return "";
  return fmt::format("{} are open after its destruction, expected none", host.open_queries());
}

}  // namespace

std::vector<std::filesystem::path> scenes_of_checkout() {
  std::vector<std::filesystem::path> files;
  std::error_code ignored;
  for (const char* name : {"shelf.json", "clutter.json", "paper_52_hybrid.json"})
    if (const auto file = std::filesystem::path("data/scenes") / name;
        std::filesystem::is_regular_file(file, ignored))
      files.push_back(file);
  return files;
}

std::vector<PluginCheck> check_plugin(const planning::Plugin& plugin,
                                      const PluginCheckOptions& options) {
  Checks checks;
  checks.add("it loads", "");
  checks.remark(
      fmt::format("{} {} from {}", plugin.name(), plugin.version(), plugin.file().string()));
  Json params;
  try {
    // Defaults are filled in after the check, so the complete set is checked again.
    params = planning::check_params(plugin, planning::check_params(plugin, Json()));
    checks.add("the default parameters fit the schema", "");
  } catch (const Error& e) {
    checks.add("the default parameters fit the schema", e.what());
    return checks.take();
  }
  checks.add("each parameter has a type, a description and a default", undescribed(plugin));
  checks.add("it works with each parameter at the ends of its range, or says why not",
             fails_at_extremes(plugin, options.timeout_s));
  Findings findings;
  for (const TrialScene& scene : trial_scenes(plugin, params, options.scenes))
    check_scene(checks, plugin, params, scene, options, findings);
  check_behaviour(checks, plugin, findings);
  checks.add("query handles are closed",
             run_in_child([&] { return open_queries(plugin, params); }, options.timeout_s));
  return checks.take();
}

}  // namespace hamelin::app

#include "plugin_check.hpp"

#include <fmt/format.h>

#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <utility>

#include "allocation_counter.hpp"
#include "child_process.hpp"
#include "command_line.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/model/make_chain.hpp"
#include "plugin_trial.hpp"

namespace hamelin::app {

namespace {

constexpr double child_timeout_s = 120.0;
constexpr int trial_ticks = 300;

// ---- a host without a world

/// A host without obstacles, which discards messages and counts query handles.
class EmptyHost final : public planning::HostServices {
 public:
  void log(std::int32_t, std::string_view) override {}
  std::size_t closest_points(std::span<const double>, double,
                             planning::ArrayOut<hamelin_contact>) override {
    return 0;
  }
  std::unique_ptr<planning::QueryServices> open_query() override {
    return std::make_unique<Counted>(open_, planning::HostServices::open_query());
  }
  [[nodiscard]] int open_queries() const noexcept { return open_; }

 private:
  /// A query of empty space that counts as open while it exists.
  class Counted final : public planning::QueryServices {
   public:
    Counted(std::atomic<int>& open, std::unique_ptr<planning::QueryServices> empty)
        : open_(open), empty_(std::move(empty)) {
      ++open_;
    }
    ~Counted() override { --open_; }
    Snapshot refresh() override { return empty_->refresh(); }
    void clearance(const double* q, std::size_t count, double time_ahead_s, double at_least_m,
                   double* out) override {
      empty_->clearance(q, count, time_ahead_s, at_least_m, out);
    }
    std::size_t contacts(const double*, double, double,
                         planning::ArrayOut<hamelin_contact>) override {
      return 0;
    }
    std::size_t self_contacts(const double*, double,
                              planning::ArrayOut<hamelin_self_contact>) override {
      return 0;
    }
    bool motion_clear(const double* q0, const double* q1, double t0_s, double t1_s,
                      double& margin_m) override {
      return empty_->motion_clear(q0, q1, t0_s, t1_s, margin_m);
    }
    void distance(const double* points, std::size_t count, double time_ahead_s, double limit_m,
                  double* distance_m, double* gradient) override {
      empty_->distance(points, count, time_ahead_s, limit_m, distance_m, gradient);
    }
    std::size_t boxes(const Eigen::Vector3d&, const Eigen::Vector3d&,
                      planning::ArrayOut<hamelin_box>) override {
      return 0;
    }
    std::size_t obstacles(double, planning::ArrayOut<hamelin_obstacle_state>) override { return 0; }

   private:
    std::atomic<int>& open_;
    std::unique_ptr<planning::QueryServices> empty_;
  };
  std::atomic<int> open_{0};
};

// Lets a planner answer three ticks on a two-link arm: at rest, in motion, and next to an obstacle.
void answer_ticks(const planning::Plugin& plugin, const Json& params, EmptyHost& host) {
  model::ChainOptions chain;
  chain.links = 2;
  const model::Model arm(model::make_chain(chain));
  hamelin_goal goal{};
  goal.struct_size = sizeof goal;
  goal.type = HAMELIN_GOAL_JOINT;
  goal.tolerance_rad = goal.speed_max = 0.05;
  const std::array<double, 2> q_goal{0.2, 0.2}, q{0.1, 0.2}, still{0.0, 0.0}, moving{0.3, -0.4};
  planning::SetupData setup(arm);
  setup.add_goal(goal, Eigen::Map<const Eigen::Vector2d>(q_goal.data()));
  setup.control_period_s = setup.deadline_s = 1e-3;
  setup.influence_m = plugin.influence_m(params).value_or(0.2);
  setup.seed = 1;
  goal.q = q_goal.data();
  auto planner = plugin.create(std::move(setup), host, params);
  planning::CommandBuffers out(2, 8, planner.series().size());
  hamelin_contact contact{};
  contact.distance_m = 0.05;
  contact.direction_world[1] = 1.0;
  contact.obstacle = HAMELIN_OBSTACLE_MAP;
  for (std::uint64_t k = 0; k < 3; ++k) {
    hamelin_tick tick{};
    tick.struct_size = sizeof tick;
    tick.k = k;
    tick.time_s = 1e-3 * static_cast<double>(k);
    tick.q = q.data();
    tick.v = k == 0 ? still.data() : moving.data();
    tick.contacts = &contact;
    tick.contact_count = k == 2 ? 1 : 0;
    tick.contact_stride = sizeof contact;
    tick.goal = &goal;
    tick.speed_scale = 1.0;
    if (!planner.tick(tick, out))
      throw Error(ErrorCode::plugin, fmt::format("tick {}: {}", k, planner.error()));
  }
}

// ---- parameters

const Json& properties_of(const planning::Plugin& plugin) {
  static const Json none = Json::object();
  const auto at = plugin.params_schema().find("properties");
  return at == plugin.params_schema().end() ? none : *at;
}

std::string undescribed(const planning::Plugin& plugin) {
  for (const auto& [key, rule] : properties_of(plugin).items())
    for (const char* what : {"description", "default"})
      if (!rule.contains(what))
        return fmt::format("'{}' has no {}, expected one for each parameter", key, what);
  return "";
}

// The schema must refuse a key that it does not list and values of another type.
std::string accepted_nonsense(const planning::Plugin& plugin) {
  const auto accepts = [&](const Json& params) {
    try {
      (void)planning::check_params(plugin, params);
      return true;
    } catch (const Error&) {
      return false;
    }
  };
  if (accepts({{"no_such_parameter", 1}}))
    return "a parameter that the schema does not list is accepted, expected an error";
  for (const auto& [key, rule] : properties_of(plugin).items())
    if (const Json nonsense{{"expected", "an error"}}; accepts({{key, Json::array({nonsense})}}))
      return fmt::format("'{}' accepts any value, expected a type or a list of values", key);
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

std::string fails_at_extremes(const planning::Plugin& plugin) {
  for (const auto& [key, rule] : properties_of(plugin).items())
    for (const Json& value : extremes(rule)) {
      const std::string failure = run_in_child(
          [&]() -> std::string {
            EmptyHost host;
            const Json params = planning::check_params(plugin, {{key, value}});
            try {
              answer_ticks(plugin, params, host);
            } catch (const Error& e) {
              const std::string line = e.what();
              const bool refused = line.find("cannot start: ") != std::string::npos;
              if (!refused || line.find("no reason given") != std::string::npos) return line;
            }
            return "";
          },
          child_timeout_s);
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
  std::string slowest;         ///< "12 of 1000 us in 'shelf.json'"
};

void keep_first(std::string& finding, std::string text) {
  if (finding.empty()) finding = std::move(text);
}

Json judge(const planning::Plugin& plugin, const Json& params, const TrialScene& scene,
           std::optional<double> deadline_s) {
  const Trial first = try_planner(plugin, params, scene, trial_ticks);
  Json out{{"failure", first.failure},
           {"p99_s", first.planner_p99_s},
           {"deadline_s", deadline_s.value_or(first.deadline_s)}};
  if (!first.failure.empty()) return out;
  if (first.allocations > 0 && !plugin.tick_allocates())
    out["allocation"] = fmt::format(
        "{}: {} allocations in ticks, the first in tick {}, expected none without "
        "HAMELIN_TICK_ALLOCATES",
        scene.name, first.allocations, first.allocating_tick);
  if (first.threads > 0 && !plugin.uses_threads())
    out["threads"] = fmt::format(
        "{}: it started {} threads, expected none without "
        "HAMELIN_USES_THREADS",
        scene.name, first.threads);
  else if (first.threads_left > 0)
    out["threads"] = fmt::format("{}: {} threads run on after its destruction, expected none",
                                 scene.name, first.threads_left);
  if (plugin.uses_threads()) return out;  // their order is not determined
  if (try_planner(plugin, params, scene, trial_ticks).answers != first.answers)
    out["repetition"] =
        fmt::format("{}: two runs with the same seed gave different answers", scene.name);
  const std::size_t again = first.answers_after_reset.size();
  if (plugin.can_reset() && (again > first.answers.size() ||
                             !std::equal(first.answers_after_reset.begin(),
                                         first.answers_after_reset.end(), first.answers.begin())))
    out["restart"] = fmt::format(
        "{}: the answers after reset differ from the first ones, expected the same", scene.name);
  return out;
}

// One process for each scene. @return what is wrong with the answers
std::string try_in(const planning::Plugin& plugin, const Json& params, const TrialScene& scene,
                   std::optional<double> deadline_s, Findings& findings) {
  const std::string text = run_in_child(
      [&] { return judge(plugin, params, scene, deadline_s).dump(); }, child_timeout_s);
  const Json found = Json::parse(text, nullptr, false);
  if (!found.is_object()) return fmt::format("{}: {}", scene.name, text);
  const auto finding = [&](const char* key) { return found.value(key, std::string()); };
  keep_first(findings.allocation, finding("allocation"));
  keep_first(findings.threads, finding("threads"));
  keep_first(findings.repetition, finding("repetition"));
  keep_first(findings.restart, finding("restart"));
  const double p99_s = found["p99_s"], limit_s = found["deadline_s"];
  const std::string times =
      fmt::format("{:.3g} of {:.3g} us in {}", 1e6 * p99_s, 1e6 * limit_s, scene.name);
  if (p99_s > limit_s)
    keep_first(
        findings.lateness,
        fmt::format("{}: 99 % of its answers take up to {:.3g} us, expected at most {:.3g} us",
                    scene.name, 1e6 * p99_s, 1e6 * limit_s));
  if (p99_s / limit_s > findings.slowest_share) {
    findings.slowest_share = p99_s / limit_s;
    findings.slowest = times;
  }
  return finding("failure");
}

// ---- the list of checks

class Checks {
 public:
  void add(std::string name, std::string failure) {
    all_.push_back({std::move(name), std::move(failure)});
  }
  /// @param test returns what is wrong, or throws it
  void run(std::string name, const std::function<std::string()>& test) {
    try {
      add(std::move(name), test());
    } catch (const Error& e) {
      add(std::move(name), e.what());
    }
  }
  [[nodiscard]] bool last_passed() const { return all_.back().failure.empty(); }
  [[nodiscard]] std::vector<PluginCheck> take() { return std::move(all_); }

 private:
  std::vector<PluginCheck> all_;
};

void check_parameters(Checks& checks, const planning::Plugin& plugin) {
  checks.run("each parameter has a description and a default", [&] { return undescribed(plugin); });
  checks.run("wrong parameters are refused", [&] { return accepted_nonsense(plugin); });
  checks.run("it starts with parameters at the ends of their ranges, or says why not",
             [&] { return fails_at_extremes(plugin); });
}

void check_trials(Checks& checks, const planning::Plugin& plugin, const Json& params,
                  const PluginCheckOptions& options) {
  std::vector<TrialScene> scenes = built_in_scenes();
  for (const auto& file : options.scenes) {
    scenes.push_back(read_trial_scene(file));
    scenes.back().scene.planner = scene::Choice{plugin.name(), params};
  }
  Findings findings;
  for (const TrialScene& scene : scenes)
    checks.run(fmt::format("valid answers in the scene: {}", scene.name),
               [&] { return try_in(plugin, params, scene, options.deadline_s, findings); });
  if (!counts_allocations())
    checks.add("allocations in ticks are not counted in this build", "");
  else
    checks.add(
        plugin.tick_allocates() ? "ticks may allocate, as declared" : "ticks do not allocate",
        findings.allocation);
  checks.add(plugin.uses_threads() ? "threads are declared and end with the planner"
                                   : "no threads are started",
             findings.threads);
  if (plugin.uses_threads())
    checks.add("equal runs are not compared, because threads are declared", "");
  else
    checks.add("equal runs give equal answers", findings.repetition);
  if (plugin.can_reset() && !plugin.uses_threads())
    checks.add("a new start repeats the run", findings.restart);
  checks.add(fmt::format("answers before the deadline (99 % within {})", findings.slowest),
             findings.lateness);
}

}  // namespace

std::vector<std::filesystem::path> installed_scenes() {
  std::vector<std::filesystem::path> folders{"data/scenes"};
  if (const auto base = prefix())
    folders.insert(folders.begin(), *base / "share" / "hamelin" / "scenes");
  std::error_code ignored;
  for (const auto& folder : folders) {
    std::vector<std::filesystem::path> files;
    for (const char* name : {"shelf.json", "clutter.json", "paper_52_hybrid.json"})
      if (std::filesystem::is_regular_file(folder / name, ignored)) files.push_back(folder / name);
    if (!files.empty()) return files;
  }
  return {};
}

std::vector<PluginCheck> check_plugin(const planning::Plugin& plugin,
                                      const PluginCheckOptions& options) {
  Checks checks;
  checks.add(
      fmt::format("{} {} loads from {}", plugin.name(), plugin.version(), plugin.file().string()),
      "");
  Json params;
  checks.run("default parameters fit the schema", [&] {
    params = planning::check_params(plugin, Json());
    return "";
  });
  if (!checks.last_passed()) return checks.take();
  check_parameters(checks, plugin);
  check_trials(checks, plugin, params, options);
  checks.run("query handles are closed", [&] {
    return run_in_child(
        [&]() -> std::string {
          EmptyHost host;
          answer_ticks(plugin, params, host);
          if (host.open_queries() == 0) return "";
          return fmt::format("{} handles are open after its destruction, expected none",
                             host.open_queries());
        },
        child_timeout_s);
  });
  return checks.take();
}

}  // namespace hamelin::app

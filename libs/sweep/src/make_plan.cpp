#include "hamelin/sweep/make_plan.hpp"

#include <fmt/format.h>

#include <optional>
#include <set>

#include "file_lock.hpp"
#include "gains.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/scene/overrides.hpp"
#include "hamelin/simulation/run.hpp"
#include "plan_scenes.hpp"
#include "variant.hpp"

namespace hamelin::sweep {

namespace {

namespace fs = std::filesystem;

// The one of these values that has this name.
template <class T>
T one_of(std::initializer_list<T> values, std::string_view name, std::string_view option) {
  std::vector<std::string_view> names;
  for (const T value : values) {
    if (scene::to_string(value) == name) return value;
    names.push_back(scene::to_string(value));
  }
  throw Error(ErrorCode::usage,
              fmt::format("{}: '{}', expected one of {}", option, name, fmt::join(names, ", ")));
}

/// Builds a plan.
class PlanBuilder {
 public:
  PlanBuilder(const fs::path& directory, const PlanOptions& options)
      : directory_(directory), options_(options) {
    if (options.files.empty() && options.clutter.maps == 0 && options.gains.sets == 0)
      throw Error(ErrorCode::usage,
                  "nothing to plan, expected problems, scenes, --clutter or --gain-sets");
    if ((options.clutter.maps > 0 || options.gains.sets > 0) && !options.base)
      throw Error(ErrorCode::usage,
                  "--clutter and --gain-sets need --base, the scene with the arm");
    if (options.seeds.empty())
      throw Error(ErrorCode::usage, "no seeds given, expected at least one");
    if (options.clutter.maps > 0 && options.clutter.pairs == 0)
      throw Error(ErrorCode::usage, "0 pairs per clutter map, expected at least 1");
    std::error_code ec;
    const fs::path scenes = directory / "scenes";
    fs::create_directories(scenes, ec);
    if (ec)
      throw Error(ErrorCode::io,
                  fmt::format("{}: cannot be created: {}", scenes.string(), ec.message()));
    lock_.emplace(directory);
  }

  Plan build() {
    entries_ = PlanScenes(directory_, options_).make();
    Plan plan;
    for (const auto& entry : entries_) plan.scenes.push_back(entry.scene);
    add_runs(plan);
    plan.ablations = options_.ablations;
    check(plan);
    add_inputs(plan);
    write_plan(plan, directory_);
    return plan;
  }

 private:
  // The planners that were asked for, or these; that of the scene if there are none.
  [[nodiscard]] std::vector<Variant> variants_or(const std::vector<std::string>& defaults) const {
    std::vector<Variant> variants;
    for (const auto& text : options_.planners.empty() ? defaults : options_.planners)
      variants.push_back(parse_variant(text, directory_));
    if (variants.empty()) variants.push_back({"", std::nullopt, {}});
    return variants;
  }

  void add_runs(Plan& plan) const {
    const std::vector<Variant> variants = variants_or({}),
                               gain_variants = variants_or({"apf", "gyro", "hybrid"});
    const auto varied = combinations(options_.vary);
    const auto sets = draw_gains(options_.gains.sets, options_.gains.seed);
    for (const auto& entry : entries_) {
      if (!entry.gains) {
        for (const auto& variant : variants)
          for (const auto& values : varied) add_run_per_seed(plan, entry, variant, values, {}, "");
        continue;
      }
      for (std::size_t i = 0; i < sets.size(); ++i) {
        const std::string name = fmt::format("gains{:04}", i + 1);
        for (const auto& variant :
             entry.reference ? std::vector{parse_variant("apf", directory_)} : gain_variants)
          for (const auto& values : varied)
            add_run_per_seed(plan, entry, variant, values, sets[i], name);
      }
    }
  }

  void add_run_per_seed(Plan& plan, const PlanScenes::Entry& entry, const Variant& variant,
                        const std::vector<std::string>& values, const std::optional<Gains>& gains,
                        const std::string& gains_name) const {
    for (const auto seed : options_.seeds) {
      PlannedRun run;
      run.scene = entry.scene.file;
      run.seed = seed;
      run.planner = variant.planner;
      run.labels = entry.labels;
      std::string planner = variant.label;
      if (planner.empty()) planner = planner_of(entry);
      if (entry.reference) planner += " without the obstacle";
      run.labels["planner"] = planner;
      run.labels["seed"] = fmt::format("{}", seed);
      run.id = entry.name + "/" + planner;
      if (gains) {
        run.labels["gains"] = gains_name;
        run.id += "/" + gains_name;
        set_gains(run, *gains);
      }
      run.set.insert(run.set.end(), variant.set.begin(), variant.set.end());
      run.set.insert(run.set.end(), options_.set.begin(), options_.set.end());
      if (options_.duration_s)
        run.set.push_back(fmt::format("/duration_s={}", *options_.duration_s));
      if (!values.empty()) {
        const std::string label = fmt::format("{}", fmt::join(values, " "));
        run.labels["values"] = label;
        run.id += "/" + label;
        run.set.insert(run.set.end(), values.begin(), values.end());
      }
      run.id += fmt::format("/s{}", seed);
      plan.runs.push_back(std::move(run));
    }
  }

  // Checks that ids are unique, and resolves the first run of each combination of planner and
  // values.
  void check(const Plan& plan) const {
    std::set<std::string> ids, seen;
    for (const auto& run : plan.runs) {
      if (!ids.insert(run.id).second)
        throw Error(
            ErrorCode::usage,
            fmt::format("run '{}' is planned twice, expected distinct planners, values and seeds",
                        run.id));
      const auto values = run.labels.find("values");
      const std::string kind = fmt::format("{} {} {}", run.labels.at("planner"), run.gains.empty(),
                                           values == run.labels.end() ? "" : values->second);
      if (seen.insert(kind).second)
        (void)simulation::full_config(read_scene(run, directory_), options_.plugin_directories);
    }
  }

  // Runs of one scene with the same values and planner read the same files; planner parameters name
  // no files.
  void add_inputs(Plan& plan) const {
    std::set<std::string> seen;
    std::set<fs::path> files;
    std::set<std::string> planners;
    for (const auto& run : plan.runs) {
      std::string kind = fmt::format("{}\n{}", run.scene, run.planner.value_or(""));
      for (const auto& assignment : run.set)
        if (!assignment.starts_with("/planner/params/")) kind.append("\n").append(assignment);
      if (!seen.insert(std::move(kind)).second) continue;
      const scene::Scene scene = read_scene(run, directory_);
      for (const auto& file : scene::input_files(scene))
        files.insert(fs::proximate(file, directory_));
      if (run.planner)
        if (const auto python = scene::python_planner(*run.planner, "--planner"))
          files.insert(python->file);
      if (scene.planner) planners.insert(scene.planner->name);
    }
    for (const auto& file : files)
      plan.inputs.push_back(
          {file.generic_string(), sha256_of_file(resolve_path(directory_, file))});
    for (const auto& name : planners)
      plan.plugins.push_back(
          {name, sha256_of_file(planning::find_plugin_file(name, options_.plugin_directories))});
  }

  // The planner that the scene itself names.
  [[nodiscard]] std::string planner_of(const PlanScenes::Entry& entry) const {
    const scene::Scene scene = scene::read_scene(directory_ / entry.scene.file);
    return scene.planner ? scene.planner->name : "none";
  }

  fs::path directory_;
  std::optional<DirectoryLock> lock_;
  const PlanOptions& options_;
  std::vector<PlanScenes::Entry> entries_;
};

}  // namespace

scene::GoalType goal_type_from(std::string_view name, std::string_view option) {
  return one_of({scene::GoalType::joint, scene::GoalType::position, scene::GoalType::pose}, name,
                option);
}

scene::Prediction prediction_from(std::string_view name, std::string_view option) {
  using enum scene::Prediction;
  return one_of({path, constant_acceleration, constant_velocity, speed_bound}, name, option);
}

Plan make_plan(const fs::path& directory, const PlanOptions& options) {
  return PlanBuilder(directory, options).build();
}

}  // namespace hamelin::sweep

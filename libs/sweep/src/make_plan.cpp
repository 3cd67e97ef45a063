#include "hamelin/sweep/make_plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "file_lock.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/scene/overrides.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/sweep/judge.hpp"
#include "sphere_on_path.hpp"

namespace hamelin::sweep {

namespace {

namespace fs = std::filesystem;
using Labels = std::map<std::string, std::string>;

// Gain sets model the segment of a link by spheres with this spacing s. At a distance d = 0.25 m
// from the obstacle's centre the nearest sphere is at most s²/8d = 0.02²/(8 · 0.25) m = 0.2 mm
// farther than the segment. The radius is negligible in comparison. docs/theory.md (13.17).
constexpr double segment_spacing_m = 0.02, segment_radius_m = 1e-4;
// Gain sets: on arrival the tip must be slower than this. The README gives the reason.
constexpr double arrival_tip_speed_m_s = 0.05;

/// A scene file of the plan, with the labels of its runs.
struct SceneEntry {
  std::string name;  ///< prefix of the ids of its runs
  PlannedScene scene;
  Labels labels;
  bool gains = false;      ///< is combined with gain sets
  bool reference = false;  ///< is the reference without the obstacle
};

/// A planner with assignments, parsed from "NAME:key=value,…".
struct Variant {
  std::string label;
  std::optional<std::string> planner;
  std::vector<std::string> set;
};

// Splits at commas outside of brackets, braces and quotes.
std::vector<std::string> split_values(const std::string& text) {
  std::vector<std::string> parts(1);
  int depth = 0;
  bool quoted = false;
  for (const char c : text) {
    if (c == '"') quoted = !quoted;
    if (!quoted && (c == '[' || c == '{')) ++depth;
    if (!quoted && (c == ']' || c == '}')) --depth;
    if (c == ',' && depth == 0 && !quoted)
      parts.emplace_back();
    else
      parts.back() += c;
  }
  return parts;
}

Variant parse_variant(const std::string& text, const fs::path& directory) {
  if (auto python = scene::python_planner(text, "--planner")) {
    python->file = fs::proximate(python->file, directory).generic_string();
    return {text, python->text(), {}};
  }
  const auto colon = text.find(':');
  Variant variant{text, text.substr(0, colon), {}};
  if (variant.planner->empty())
    throw Error(ErrorCode::usage,
                fmt::format("--planner {}: no name, expected NAME or NAME:key=value,...", text));
  // "NAME+GUIDE": a guide searches paths for the planner.
  if (const auto plus = variant.planner->rfind('+'); plus != std::string::npos) {
    const std::string guide = variant.planner->substr(plus + 1);
    if (scene::guide_type(guide)) {
      variant.planner->resize(plus);
      variant.set.push_back("/planner/guide=" + guide);
    }
  }
  if (colon == std::string::npos) return variant;
  for (const auto& part : split_values(text.substr(colon + 1))) {
    const auto equals = part.find('=');
    if (equals == 0 || equals == std::string::npos)
      throw Error(
          ErrorCode::usage,
          fmt::format("--planner {}: '{}' is not a parameter, expected key=value", text, part));
    variant.set.push_back("/planner/params/" + part);
  }
  return variant;
}

std::vector<Variant> parse_variants(const PlanOptions& options,
                                    const std::vector<std::string>& defaults,
                                    const fs::path& directory) {
  std::vector<Variant> variants;
  for (const auto& text : options.planners.empty() ? defaults : options.planners)
    variants.push_back(parse_variant(text, directory));
  if (variants.empty()) variants.push_back({"", std::nullopt, {}});
  return variants;
}

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

/// All combinations of the varied values.
std::vector<std::vector<std::string>> combinations(const std::vector<std::string>& vary) {
  std::vector<std::vector<std::string>> all{{}};
  for (const auto& text : vary) {
    const auto equals = text.find('=');
    if (text.empty() || text.front() != '/' || equals == std::string::npos)
      throw Error(ErrorCode::usage,
                  fmt::format("--vary {}: expected /json/pointer=VALUE,VALUE,...", text));
    std::vector<std::vector<std::string>> extended;
    for (const auto& combination : all)
      for (const auto& value : split_values(text.substr(equals + 1))) {
        extended.push_back(combination);
        extended.back().push_back(text.substr(0, equals + 1) + value);
      }
    all = std::move(extended);
  }
  return all;
}

std::string number(double value) {
  return fmt::format("{}", value);
}

Json array(const Eigen::VectorXd& x) {
  return std::vector<double>(x.data(), x.data() + x.size());
}

Eigen::VectorXd joint_vector(const Json& values) {
  const auto list = values.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(list.data(), static_cast<Eigen::Index>(list.size()));
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
    fs::create_directories(scenes(), ec);
    if (ec)
      throw Error(ErrorCode::io,
                  fmt::format("{}: cannot be created: {}", scenes().string(), ec.message()));
    lock_.emplace(directory);
  }

  Plan build() {
    const std::size_t all =
        options_.files.size() + options_.clutter.maps + (options_.gains.sets > 0 ? 1U : 0U);
    std::size_t done = 0;
    const auto report_progress = [&] {
      if (options_.on_scene) options_.on_scene(++done, all);
    };
    for (const auto& file : options_.files) {
      add_file(file);
      report_progress();
    }
    for (std::size_t i = 0; i < options_.clutter.maps; ++i) {
      add_clutter(i);
      report_progress();
    }
    if (options_.gains.sets > 0) {
      add_gain_scenes();
      report_progress();
    }
    Plan plan;
    for (const auto& entry : entries_) plan.scenes.push_back(entry.scene);
    add_runs(plan);
    check(plan);
    add_inputs(plan);
    write_plan(plan, directory_);
    return plan;
  }

 private:
  [[nodiscard]] fs::path scenes() const { return directory_ / "scenes"; }

  void add_scene(const std::string& name, const Json& document, Labels labels, bool gains = false,
                 bool reference = false) {
    const fs::path file = scenes() / (name + ".json");
    write_file_atomically(file, document.dump(2) + "\n");
    add_scene_file(name, file, std::move(labels), std::nullopt, gains, reference);
  }

  void add_scene_file(const std::string& name, const fs::path& file, Labels labels,
                      const std::optional<Feasibility>& known = std::nullopt, bool gains = false,
                      bool reference = false) {
    if (!names_.insert(name).second)
      throw Error(ErrorCode::usage,
                  fmt::format("{}: another file also has the name '{}', expected unique names",
                              file.string(), name));
    SceneEntry entry{name, {}, std::move(labels), gains, reference};
    const Feasibility found = known ? *known : feasibility(scene::read_scene(file), {});
    entry.scene.feasible = found.feasible;
    entry.scene.reason = found.reason;
    entry.scene.file = fs::proximate(file, directory_).generic_string();
    entry.scene.sha256 = sha256_of_file(file);
    entries_.push_back(std::move(entry));
  }

  void add_file(const fs::path& file) {
    const Json document = read_json(file);
    if (document.is_object() && document.value("schema", Json()) == "hamelin.scene/1") {
      if (options_.sphere_on_path)
        throw Error(
            ErrorCode::usage,
            fmt::format("{}: is a scene, expected problems when spheres are placed on paths",
                        file.string()));
      const scene::Scene scene = scene::read_scene(file);
      const std::string name = file.stem().string();
      const std::string goal =
          scene.goals.empty() ? "none" : std::string(scene::type_name(scene.goals.front()));
      add_scene_file(
          name, file,
          {{"family", name}, {"problem", name}, {"goal", goal}, {"map", map_label(scene)}});
    } else if (document.is_object() && !document.contains("schema") &&
               document.contains("obstacles")) {
      add_problem(file, document);
    } else {
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: is neither a scene nor a problem with start, goal and obstacles",
                              file.string()));
    }
  }

  [[nodiscard]] static std::string map_label(const scene::Scene& scene) {
    return scene.map ? scene.map->file.filename().string() : "none";
  }

  void add_problem(const fs::path& file, const Json& problem) {
    if (options_.problem.robot.empty())
      throw Error(ErrorCode::usage,
                  fmt::format("{}: is a problem, expected --robot", file.string()));
    const std::string name = file.stem().string();
    scene::ProblemOptions options = options_.problem;
    options.output = scenes() / (name + ".json");
    const std::string map =
        fmt::format("{} m {}", options.resolution_m, scene::to_string(options.mark));
    const std::string family = problem.contains("family") && problem["family"].is_string()
                                   ? problem["family"].get<std::string>()
                                   : name;
    const Labels labels{{"family", family}, {"problem", name}, {"map", map}};
    if (options_.sphere_on_path) return add_sphere_on_path(file, options, labels);
    std::optional<Feasibility> found;
    for (const auto type :
         options_.goals.empty() ? std::vector{scene::GoalType::joint} : options_.goals) {
      const std::string goal(scene::to_string(type));
      options.goal = type;
      scene::make_scene_from_problem(file, options);  // the map is the same each time
      if (!found)
        found = feasibility(scene::read_scene(options.output), {joint_vector(problem.at("goal"))});
      const fs::path scene_file = scenes() / fmt::format("{}-{}.json", name, goal);
      fs::rename(options.output, scene_file);
      Labels all = labels;
      all["goal"] = goal;
      add_scene_file(scene_file.stem().string(), scene_file, std::move(all), found);
    }
  }

  void add_sphere_on_path(const fs::path& file, const scene::ProblemOptions& problem,
                          Labels labels) {
    const SphereOnPath& sphere_options = *options_.sphere_on_path;
    scene::make_scene_from_problem(file, problem);
    const PathWithSphere found =
        place_sphere_on_path(problem.output, sphere_options, options_.plugin_directories);
    Json document = read_json(problem.output);
    fs::remove(problem.output);
    if (!found.reason.empty()) {
      if (options_.on_note)
        options_.on_note(fmt::format("{}: is left out: {}", file.string(), found.reason));
      return;
    }
    Json points = Json::array();
    for (const auto& q : found.path) points.push_back(array(q));
    document["goals"] = {{{"type", "path"}, {"q", std::move(points)}}};
    Json sphere{{"name", "on the path"},
                {"type", "sphere"},
                {"radius_m", sphere_options.radius_m},
                {"position_m", {found.center.x(), found.center.y(), found.center.z()}}};
    if (sphere_options.visible_within_m) {
      sphere["known"] = false;
      sphere["visible_within_m"] = *sphere_options.visible_within_m;
    }
    labels["goal"] = "path";
    labels["sphere"] = sphere_options.visible_within_m
                           ? fmt::format("seen at {} m", *sphere_options.visible_within_m)
                           : "known";
    if (sphere_options.swing_m > 0.0) let_swing(sphere, found.swing, labels);
    document["obstacles"].push_back(std::move(sphere));
    add_scene(labels.at("problem") + "-path", document, labels);
  }

  void let_swing(Json& sphere, const Eigen::Vector3d& swing, Labels& labels) const {
    const SphereOnPath& options = *options_.sphere_on_path;
    sphere["motion"] = {{"type", "sine"},
                        {"amplitude_m", {swing.x(), swing.y(), swing.z()}},
                        {"period_s", options.swing_period_s}};
    if (options.prediction == scene::Prediction::speed_bound)
      sphere["prediction"]["speed_max"] =
          1.02 * 2.0 * std::numbers::pi * swing.norm() / options.swing_period_s;
    else
      sphere["prediction"] = scene::to_string(options.prediction);
    labels["sphere"] = fmt::format("swings in {} s", options.swing_period_s);
    labels["prediction"] = scene::to_string(options.prediction);
  }

  // The document of the base scene, with file names relative to the directory of the scenes.
  [[nodiscard]] Json base_document() const {
    Json document = read_json(*options_.base);
    const scene::Scene scene =
        scene::scene_from_json(document, options_.base->parent_path(), options_.base->string());
    document["robot"]["file"] = fs::proximate(scene.robot.file, scenes()).generic_string();
    if (scene.robot.spheres)
      document["robot"]["spheres"] = fs::proximate(*scene.robot.spheres, scenes()).generic_string();
    if (scene.robot.srdf)
      document["robot"]["srdf"] = fs::proximate(*scene.robot.srdf, scenes()).generic_string();
    return document;
  }

  void add_clutter(std::size_t index) {
    const ClutterScenes& clutter_options = options_.clutter;
    scene::Clutter clutter = clutter_options.clutter;
    clutter.seed += index;
    const std::string name = fmt::format("clutter_{:04}", clutter.seed);
    scene::MakeMapOptions map;
    map.resolution_m = options_.problem.resolution_m;
    map.mark = options_.problem.mark;
    map.primitives = scene::make_clutter(clutter);
    map.output = scenes() / (name + ".bt");
    scene::make_map(map);
    Json document = base_document();
    document["map"] = {{"file", map.output.filename().string()}};
    document["goals"] = Json::array();
    document["obstacles"] = Json::array();
    for (auto primitive : map.primitives) {
      primitive.judge_only = true;
      Json obstacle = scene::to_json(primitive);
      for (auto it = obstacle.begin(); it != obstacle.end();)
        it = it->is_null() ? obstacle.erase(it) : std::next(it);
      document["obstacles"].push_back(std::move(obstacle));
    }
    PairOptions draw = clutter_options.draw;
    draw.count = clutter_options.pairs;
    draw.seed += index;
    const auto drawn = draw_pairs(scene::scene_from_json(document, scenes(), name), draw);
    for (std::size_t k = 0; k < drawn.pairs.size(); ++k) {
      document["start"] = {{"q", array(drawn.pairs[k].start)}};
      document["goals"] = {{{"type", "joint"}, {"q", array(drawn.pairs[k].goal)}}};
      add_scene(clutter_options.pairs == 1 ? name : fmt::format("{}-{:03}", name, k + 1), document,
                {{"family", "clutter"},
                 {"problem", name},
                 {"goal", "joint"},
                 {"map", fmt::format("{} m {}", map.resolution_m, scene::to_string(map.mark))}});
    }
  }

  // Adds the scene with the obstacle and its reference without. The README describes the set-up.
  void add_gain_scenes() {
    const scene::Scene base = scene::read_scene(*options_.base);
    model::Robot robot = description::read_robot(
        base.robot.file, {base.robot.tip, base.robot.spheres, base.robot.srdf});
    for (auto& link : robot.links) {
      if (link.segments.empty())
        throw Error(
            ErrorCode::invalid,
            fmt::format("{}: link '{}' has no segments, expected at least one for gain sets",
                        base.robot.file.string(), link.name));
      link.spheres.clear();
      for (auto& segment : link.segments) {
        const double length = (segment.to_m - segment.from_m).norm();
        const int parts =
            std::max(1, static_cast<int>(std::ceil(length / segment_spacing_m - 1e-9)));
        for (int i = 0; i <= parts; ++i) {
          model::Sphere sphere;
          sphere.center_m =
              segment.from_m + (static_cast<double>(i) / parts) * (segment.to_m - segment.from_m);
          sphere.radius_m = std::max(segment.radius_m, segment_radius_m);
          link.spheres.push_back(sphere);
        }
        segment.radius_m = 0.0;  // collisions are those of the row of spheres
      }
    }
    const std::string robot_file = fmt::format("{}_segments.json", robot.name);
    write_file_atomically(scenes() / robot_file, description::robot_to_json(robot).dump(1) + "\n");
    Json document = read_json(*options_.base);
    document["robot"] = {{"file", robot_file}};
    document.erase("gravity_m_s2");
    document.erase("planner");
    // half of the sets do not damp the joints, which then keep moving while the tip rests at the
    // goal
    for (auto& goal : document["goals"]) {
      goal.erase("speed_max");
      goal["tip_speed_max_m_s"] = arrival_tip_speed_m_s;
    }
    document["integrator"] = {{"name", "semi-implicit-euler"}};
    document["step_s"] = 0.004;
    document["duration_s"] = 40;
    document["stall"] = {{"speed_m_s", 0.002}, {"distance_m", 0.2}, {"hold_s", 1}};
    const auto labels = [](const char* problem) {
      return Labels{
          {"family", "example 5.2"}, {"problem", problem}, {"goal", "position"}, {"map", "none"}};
    };
    add_scene("gains", document, labels("obstacle"), true);
    document.erase("obstacles");
    add_scene("gains_free", document, labels(no_obstacle), true, true);
  }

  void add_runs(Plan& plan) const {
    const auto variants = parse_variants(options_, {}, directory_),
               gain_variants = parse_variants(options_, {"apf", "gyro", "hybrid"}, directory_);
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

  void add_run_per_seed(Plan& plan, const SceneEntry& entry, const Variant& variant,
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
        add_gains(run, *gains);
      }
      run.set.insert(run.set.end(), variant.set.begin(), variant.set.end());
      run.set.insert(run.set.end(), options_.set.begin(), options_.set.end());
      if (options_.duration_s) run.set.push_back("/duration_s=" + number(*options_.duration_s));
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

  // Each planner has its own names for the gains.
  static void add_gains(PlannedRun& run, const Gains& g) {
    run.gains = {{"k_p", g.k_p},
                 {"k_v", g.k_v},
                 {"joint_damping", g.joint_damping},
                 {"eta", g.eta},
                 {"k_obs", g.k_obs}};
    const auto set = [&](const char* name, double value) {
      run.set.push_back(fmt::format("/planner/params/{}={}", name, value));
    };
    // the host's stall rule is for planners without a rule of their own; hybrid does not move while
    // it searches
    if (run.planner == "hybrid") run.set.emplace_back("/stall=null");
    set("k_p", g.k_p);
    set("k_v", g.k_v);
    set("joint_damping", g.joint_damping);
    if (run.planner == "apf")
      set("eta", g.eta);
    else
      set(run.planner == "hybrid" ? "steering_gain" : "k_obs", g.k_obs);
  }

  // The planner that the scene itself names.
  [[nodiscard]] std::string planner_of(const SceneEntry& entry) const {
    const scene::Scene scene = scene::read_scene(directory_ / entry.scene.file);
    return scene.planner ? scene.planner->name : "none";
  }

  fs::path directory_;
  std::optional<DirectoryLock> lock_;
  const PlanOptions& options_;
  std::vector<SceneEntry> entries_;
  std::set<std::string> names_;
};

}  // namespace

// docs/theory.md (13.24)
scene::GoalType goal_type_from(std::string_view name, std::string_view option) {
  return one_of({scene::GoalType::joint, scene::GoalType::position, scene::GoalType::pose}, name,
                option);
}

scene::Prediction prediction_from(std::string_view name, std::string_view option) {
  using enum scene::Prediction;
  return one_of({path, constant_acceleration, constant_velocity, speed_bound}, name, option);
}

std::vector<Gains> draw_gains(std::size_t count, std::uint64_t seed) {
  Rng rng(seed);
  const auto power = [&](double low, double high) {
    return std::pow(10.0, rng.uniform(low, high));
  };
  std::vector<Gains> sets(count);
  for (auto& g : sets) {
    g.k_p = power(-0.5, 1.5);
    g.k_v = 2.0 * std::sqrt(g.k_p) * power(-0.6, 0.6);
    // both numbers are always drawn: the numbers drawn later do not depend on `damped`
    const bool damped = rng.uniform() >= 0.5;
    const double damping = power(-1.5, 0.5);
    g.joint_damping = damped ? damping : 0.0;
    g.eta = power(-2.0, 1.5);
    g.k_obs = power(-1.0, 2.0);
  }
  return sets;
}

Plan make_plan(const fs::path& directory, const PlanOptions& options) {
  return PlanBuilder(directory, options).build();
}

}  // namespace hamelin::sweep

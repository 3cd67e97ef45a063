#include "plan_scenes.hpp"

#include <fmt/format.h>

#include <numbers>

#include "gains.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/scene/make.hpp"
#include "hamelin/scene/scene.hpp"
#include "sphere_on_path.hpp"

namespace hamelin::sweep {

namespace {

namespace fs = std::filesystem;

Json array(const Eigen::VectorXd& x) {
  return std::vector<double>(x.data(), x.data() + x.size());
}

Eigen::VectorXd joint_vector(const Json& values) {
  const auto list = values.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(list.data(), static_cast<Eigen::Index>(list.size()));
}

std::string map_label(const scene::Scene& scene) {
  if (!scene.map) return "none";
  return scene.map->file.empty() ? "seen" : scene.map->file.filename().string();
}

}  // namespace

std::vector<PlanScenes::Entry> PlanScenes::make() && {
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
  return std::move(entries_);
}

void PlanScenes::add_scene(const std::string& name, const Json& document, Labels labels, bool gains,
                           bool reference) {
  const fs::path file = scenes() / (name + ".json");
  write_file_atomically(file, document.dump(2) + "\n");
  add_scene_file(name, file, std::move(labels), std::nullopt, gains, reference);
}

void PlanScenes::add_scene_file(const std::string& name, const fs::path& file, Labels labels,
                                const std::optional<Feasibility>& known, bool gains,
                                bool reference) {
  if (!names_.insert(name).second)
    throw Error(ErrorCode::usage,
                fmt::format("{}: another file also has the name '{}', expected unique names",
                            file.string(), name));
  Entry entry{name, {}, std::move(labels), gains, reference};
  const Feasibility found = known ? *known : feasibility(scene::read_scene(file), {});
  entry.scene.feasible = found.feasible;
  entry.scene.reason = found.reason;
  entry.scene.file = fs::proximate(file, directory_).generic_string();
  entry.scene.sha256 = sha256_of_file(file);
  entries_.push_back(std::move(entry));
}

void PlanScenes::add_file(const fs::path& file) {
  const Json document = read_json(file);
  if (document.is_object() && document.value("schema", Json()) == "hamelin.scene/1") {
    if (options_.sphere_on_path)
      throw Error(ErrorCode::usage,
                  fmt::format("{}: is a scene, expected problems when spheres are placed on paths",
                              file.string()));
    const scene::Scene scene = scene::read_scene(file);
    const std::string name = file.stem().string();
    const std::string goal =
        scene.goals.empty() ? "none" : std::string(scene::type_name(scene.goals.front()));
    Labels labels{{"family", name}, {"problem", name}, {"goal", goal}, {"map", map_label(scene)}};
    if (const auto given = options_.labels.find(name); given != options_.labels.end())
      for (const auto& [label, value] : given->second) labels[label] = value;
    add_scene_file(name, file, std::move(labels));
  } else if (document.is_object() && !document.contains("schema") &&
             document.contains("obstacles")) {
    add_problem(file, document);
  } else {
    throw Error(ErrorCode::invalid,
                fmt::format("{}: is neither a scene nor a problem with start, goal and obstacles",
                            file.string()));
  }
}

void PlanScenes::add_problem(const fs::path& file, const Json& problem) {
  if (options_.problem.robot.empty())
    throw Error(ErrorCode::usage, fmt::format("{}: is a problem, expected --robot", file.string()));
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

void PlanScenes::add_sphere_on_path(const fs::path& file, const scene::ProblemOptions& problem,
                                    Labels labels) {
  const SphereOnPath& sphere_options = *options_.sphere_on_path;
  scene::make_scene_from_problem(file, problem);
  const PathWithSphere found = place_sphere_on_path(problem.output, sphere_options);
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

void PlanScenes::let_swing(Json& sphere, const Eigen::Vector3d& swing, Labels& labels) const {
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

Json PlanScenes::base_document() const {
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

void PlanScenes::add_clutter(std::size_t index) {
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

void PlanScenes::add_gain_scenes() {
  Json document = make_gain_scene(*options_.base, scenes());
  const auto labels = [](const char* problem) {
    return Labels{
        {"family", "example 5.2"}, {"problem", problem}, {"goal", "position"}, {"map", "none"}};
  };
  add_scene("gains", document, labels("obstacle"), true);
  document.erase("obstacles");
  add_scene("gains_free", document, labels(no_obstacle), true, true);
}

}  // namespace hamelin::sweep

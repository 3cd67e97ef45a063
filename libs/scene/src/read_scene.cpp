#include "read_scene.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "hamelin/core/text.hpp"
#include "hamelin/io/file.hpp"

namespace hamelin::scene {

namespace {

RobotRef read_robot_ref(const Reader& in, const std::filesystem::path& folder) {
  const auto path = [&](const char* key) -> std::optional<std::filesystem::path> {
    const auto text = in.maybe<std::string>(key);
    return text ? std::optional(resolve_path(folder, *text)) : std::nullopt;
  };
  return {path("file").value_or(folder), in.maybe<std::string>("tip"), path("spheres"),
          path("srdf")};
}

// Unlike other values, null differs from a missing one: it means no gravity. Logs of earlier
// versions have null where a scene is weightless.
Eigen::Vector3d read_gravity(const Json& document, const Reader& in, const Eigen::Vector3d& usual) {
  const char* const key = "gravity_m_s2";
  if (!document.contains(key)) return usual;
  return in.vector(key, Eigen::Vector3d::Zero());
}

GuideSpec read_guide(const Reader& planner) {
  GuideSpec guide;
  guide.type =
      guide_type(planner.get<std::string>("guide", "on-request")).value_or(GuideType::on_request);
  const Reader options = planner.child("guide_options");
  guide.margin_m = options.maybe<double>("margin_m");
  guide.checks_max = options.get("checks_max", guide.checks_max);
  guide.improve_checks = options.get("improve_checks", guide.improve_checks);
  guide.searches_max = options.get("searches_max", guide.searches_max);
  guide.check_time_s = options.get("check_time_s", guide.check_time_s);
  return guide;
}

// Cameras may find obstacles that no scene names.
void check_named(const Reader& in, const Scene& scene) {
  if (!scene.sensors.empty()) return;
  const std::vector<std::string> names = names_of(scene.obstacles);
  for (std::size_t i = 0; i < scene.goals.size(); ++i)
    for (const std::string& name : scene.goals[i].may_touch.obstacles)
      if (std::find(names.begin(), names.end(), name) == names.end())
        in.fail(fmt::format("goals/{}/may_touch/obstacles", i).c_str(),
                fmt::format("there is no obstacle '{}', expected one of the scene's {}{}", name,
                            names.size(), did_you_mean(name, names)));
}

}  // namespace

Scene scene_from_json(const Json& document, const std::filesystem::path& base_dir,
                      const std::string& where) {
  Scene scene = parts_from_json(document, base_dir, where);
  check_named(Reader(document, where + ": "), scene);
  return scene;
}

Scene parts_from_json(const Json& document, const std::filesystem::path& base_dir,
                      const std::string& where) {
  check_shipped_schema(document, "scene", where);
  const Reader in(document, where + ": ");
  Scene scene;
  scene.name = where;
  scene.robot = read_robot_ref(in.child("robot"), base_dir);
  scene.base = in.child("base").pose();
  scene.base_quaternion_wxyz = in.child("base").quaternion();
  scene.gravity_m_s2 = read_gravity(document, in, scene.gravity_m_s2);
  scene.start_q = in.child("start").joints("q");
  scene.start_v = in.child("start").joints("v");
  scene.goals = read_goals(in, base_dir);
  scene.obstacles = read_obstacles(in, base_dir);
  if (in.find("map") != nullptr) scene.map = read_map_spec(in.child("map"), base_dir);
  scene.sensors = read_sensors(in, scene);
  scene.model = read_model(in.child("model"));
  if (in.find("planner") != nullptr) {
    const Reader planner = in.child("planner");
    scene.planner =
        Choice{planner.get<std::string>("name", ""), planner.get<Json>("params", Json::object())};
    scene.guide = read_guide(planner);
  }
  const Reader integrator = in.child("integrator");
  scene.integrator = {integrator.get<std::string>("name", "hamel-variational"),
                      integrator.get<Json>("params", Json::object())};
  if (in.find("stall") != nullptr) {
    const Reader stall = in.child("stall");
    scene.stall = StallRule{stall.get("speed_m_s", 0.002), stall.get("distance_m", 0.2),
                            stall.get("hold_s", 1.0)};
  }
  scene.step_s = in.get("step_s", 0.001);
  scene.duration_s = in.get("duration_s", 10.0);
  scene.seed = in.get<std::uint64_t>("seed", 1);
  scene.actuation = read_actuation(in.child("actuation"), scene.step_s);
  scene.plant = read_plant(in, in.child("plant"), scene.actuation.type);
  scene.safety = read_safety(in.child("safety"));
  scene.events = read_events(in, base_dir, scene);
  scene.wrenches = read_wrenches(in);
  return scene;
}

std::vector<std::filesystem::path> input_files(const Scene& scene) {
  std::vector<std::filesystem::path> files{scene.robot.file};
  if (scene.robot.spheres) files.push_back(*scene.robot.spheres);
  if (scene.robot.srdf) files.push_back(*scene.robot.srdf);
  for (const Obstacle& obstacle : scene.obstacles)
    if (const auto file = waypoint_file(obstacle); !file.empty()) files.push_back(file);
  for (const Goal& goal : scene.goals) {
    if (!goal.path_file.empty()) files.push_back(goal.path_file);
    if (const auto file = target_file(goal); !file.empty()) files.push_back(file);
  }
  if (!scene.map) return files;
  if (!scene.map->file.empty()) files.push_back(scene.map->file);
  for (const MapChangeSpec& change : scene.map->changes)
    if (change.file) files.push_back(*change.file);
  for (const Event& event : scene.events)
    if (event.map && event.map->file) files.push_back(*event.map->file);
  return files;
}

std::filesystem::path target_file(const Goal& goal) {
  if (!goal.motion) return goal.stream.file;
  const auto* waypoints = std::get_if<WaypointMotion>(&*goal.motion);
  return waypoints != nullptr ? waypoints->path->file() : std::filesystem::path();
}

Scene read_scene(const std::filesystem::path& file) {
  return scene_from_json(read_json(file), file.parent_path(), file.string());
}

}  // namespace hamelin::scene

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/scene/parts.hpp"
#include "hamelin/task/task.hpp"

namespace hamelin::task {

using Eigen::Vector3d;
using geometry::SE3;

namespace {

constexpr double duration_s = 60.0;

[[noreturn]] void refuse(const std::string& place, const std::string& what) {
  throw Error(ErrorCode::invalid, fmt::format("{}: {}", place, what));
}

// The poses of an object with position_m, quaternion_wxyz and turns.
std::vector<SE3> poses_of(const Json& given, const std::string& place, bool turns_behind) {
  Json goal{{"type", "pose"},
            {"position_m", given["position_m"]},
            {"quaternion_wxyz", given.value("quaternion_wxyz", Json{1.0, 0.0, 0.0, 0.0})}};
  const SE3 pose = scene::goals_from_json(goal, {}, place).front().pose;
  std::vector<SE3> out;
  const int turns = given.value("turns", 1);
  for (int k = 0; k < turns; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / turns;
    const SE3 turn(Eigen::AngleAxisd(angle, Vector3d::UnitZ()).toRotationMatrix(),
                   Vector3d::Zero());
    out.push_back(turns_behind ? pose * turn : turn * pose);
  }
  return out;
}

scene::Allowance support_of(const Json& given, const char* key, const std::string& place) {
  const Json support = given.value(key, Json());
  if (support.is_null()) return {};
  const Json goal{{"type", "position"}, {"position_m", {0, 0, 0}}, {"may_touch", support}};
  return scene::goals_from_json(goal, {}, fmt::format("{}/{}", place, key)).front().may_touch;
}

Object read_object(const Json& given, const std::string& place) {
  Json solid = given;
  for (const char* key : {"mass_kg", "in_map", "grasps", "stands_on"}) solid.erase(key);
  Object out;
  out.solid = scene::obstacle_from_json(solid, {}, place);
  out.mass_kg = given.value("mass_kg", 0.0);
  out.in_map = given.value("in_map", false);
  out.stands_on = support_of(given, "stands_on", place);
  for (std::size_t i = 0; i < given["grasps"].size(); ++i)
    for (const SE3& grasp :
         poses_of(given["grasps"][i], fmt::format("{}/grasps/{}", place, i), false))
      out.grasps.push_back(grasp);
  return out;
}

const char* key_of(const std::string& type) {
  return type == "pick" ? "object" : type == "place" ? "position_m" : "goal";
}

void check_keys(const Json& given, const std::string& type, const std::string& place) {
  for (const auto& [key, value] : given.items()) {
    const bool pick = key == "object" || key == "approach_axis",
               place_only = key == "position_m" || key == "quaternion_wxyz" || key == "turns" ||
                            key == "gap_m" || key == "tilt_rad" || key == "speed_m_s" ||
                            key == "onto",
               both = key == "approach_m" || key == "lift_m";
    if ((pick && type != "pick") || (place_only && type != "place") || (both && type == "move") ||
        (key == "goal" && type != "move"))
      refuse(fmt::format("{}/{}", place, key), fmt::format("is not allowed for a {}", type));
  }
  if (!given.contains(key_of(type)))
    refuse(fmt::format("{}/{}", place, key_of(type)),
           fmt::format("is missing, expected for a {}", type));
}

Pick read_pick(const Json& given, const std::vector<Object>& objects, const std::string& place) {
  Pick out;
  const auto name = given["object"].get<std::string>();
  std::vector<std::string> names;
  names.reserve(objects.size());
  for (const Object& object : objects) names.push_back(object.solid.name);
  while (out.object < names.size() && names[out.object] != name) ++out.object;
  if (out.object == names.size())
    refuse(place + "/object", fmt::format("there is no object '{}', expected one of the {}{}", name,
                                          names.size(), did_you_mean(name, names)));
  out.approach_m = given.value("approach_m", out.approach_m);
  out.lift_m = given.value("lift_m", out.lift_m);
  if (const auto axis = given.value("approach_axis", std::vector<double>()); !axis.empty())
    out.approach_axis = Vector3d(axis[0], axis[1], axis[2]);
  if (!(std::abs(out.approach_axis.norm() - 1.0) <= 1e-3))
    refuse(place + "/approach_axis",
           fmt::format("its length is {:.6g}, expected a unit vector", out.approach_axis.norm()));
  out.approach_axis.normalize();
  return out;
}

Place read_place(const Json& given, const std::string& place) {
  Place out;
  out.poses = poses_of(given, place, true);
  out.gap_m = given.value("gap_m", out.gap_m);
  out.lower_m = given.value("lift_m", out.lower_m);
  out.retreat_m = given.value("approach_m", out.retreat_m);
  if (const Json tilt = given.value("tilt_rad", Json()); !tilt.is_null())
    out.tilt_rad = tilt.get<double>();
  if (const Json speed = given.value("speed_m_s", Json()); !speed.is_null())
    out.speed_m_s = speed.get<double>();
  out.onto = support_of(given, "onto", place);
  return out;
}

// What is held at each step must be clear: one object at a time.
std::vector<Step> read_steps(const Json& list, const std::vector<Object>& objects,
                             const std::filesystem::path& base_dir, const std::string& where) {
  std::vector<Step> out;
  std::string held;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::string place = fmt::format("{}: /steps/{}", where, i);
    const auto type = list[i]["type"].get<std::string>();
    check_keys(list[i], type, place);
    if (type == "pick" && !held.empty())
      refuse(place, fmt::format("'{}' is held already, expected a place before", held));
    if (type == "place" && held.empty()) refuse(place, "nothing is held, expected a pick before");
    if (type == "pick") {
      const Pick pick = read_pick(list[i], objects, place);
      held = objects[pick.object].solid.name;
      out.emplace_back(pick);
    } else if (type == "place") {
      held.clear();
      out.emplace_back(read_place(list[i], place));
    } else {
      const auto goals = scene::goals_from_json(list[i]["goal"], base_dir, place + "/goal");
      if (goals.front().type == scene::GoalType::follow)
        refuse(place + "/goal/type", "is follow, expected a goal that is reached");
      out.emplace_back(Move{goals.front()});
    }
  }
  return out;
}

void check_supports(const Task& task, const std::string& where) {
  const std::vector<std::string> names = names_of(task.scene.obstacles);
  const auto check = [&](const scene::Allowance& support, const std::string& place) {
    for (const std::string& name : support.obstacles)
      if (std::find(names.begin(), names.end(), name) == names.end())
        refuse(fmt::format("{}: {}/obstacles", where, place),
               fmt::format("there is no obstacle '{}', expected one of the scene's {}{}", name,
                           names.size(), did_you_mean(name, names)));
  };
  for (std::size_t i = 0; i < task.objects.size(); ++i)
    check(task.objects[i].stands_on, fmt::format("/objects/{}/stands_on", i));
  for (std::size_t i = 0; i < task.steps.size(); ++i)
    if (const auto* place = std::get_if<Place>(&task.steps[i]))
      check(place->onto, fmt::format("/steps/{}/onto", i));
}

}  // namespace

Task task_from_json(const Json& document, const std::filesystem::path& base_dir,
                    const std::string& where) {
  check_shipped_schema(document, "task", where);
  Json given = document["scene"];
  for (const char* key : {"goals", "events"})
    if (given.contains(key) && !given[key].empty())
      refuse(fmt::format("{}: /scene/{}", where, key), "is given, expected steps in place of it");
  if (!given.contains("duration_s")) given["duration_s"] = duration_s;
  Task task;
  task.scene = scene::scene_from_json(given, base_dir, where + ": /scene");
  task.scene.name = where;
  const Json& objects = document["objects"];
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const std::string place = fmt::format("{}: /objects/{}", where, i);
    task.objects.push_back(read_object(objects[i], place));
    const scene::Obstacle& solid = task.objects.back().solid;
    if (task.objects.back().in_map && !task.scene.map)
      refuse(place + "/in_map", "is true, but there is no map, expected one in the scene");
    for (const scene::Obstacle& other : task.scene.obstacles)
      if (other.name == solid.name)
        refuse(place + "/name",
               fmt::format("'{}' is the name of another obstacle, expected one of its own",
                           solid.name));
    task.scene.obstacles.push_back(solid);
  }
  task.steps = read_steps(document["steps"], task.objects, base_dir, where);
  check_supports(task, where);
  return task;
}

}  // namespace hamelin::task

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "detail.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"

namespace hamelin::description {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using geometry::SE3;

constexpr const char* schema_name = "hamelin.robot/1";

template <int size>
Eigen::Matrix<double, size, 1> numbers_of(const Json& list) {
  Eigen::Matrix<double, size, 1> numbers;
  for (int i = 0; i < size; ++i) numbers[i] = list[static_cast<std::size_t>(i)].get<double>();
  return numbers;
}

Vector3d vector_of(const Json& list) {
  return numbers_of<3>(list);
}

Json json_of(const Vector3d& v) {
  return Json::array({v.x(), v.y(), v.z()});
}

SE3 pose_of(const Json& json, const std::string& where) {
  try {
    return {geometry::rotation_from_wxyz(numbers_of<4>(json["quaternion_wxyz"])),
            vector_of(json["position_m"])};
  } catch (const Error& e) {
    throw Error(ErrorCode::invalid, fmt::format("{}/{}", where, e.what()));
  }
}

void put_pose(Json& json, const SE3& pose) {
  const Eigen::Vector4d q = geometry::quaternion_wxyz(pose.R());
  json["position_m"] = json_of(pose.p());
  json["quaternion_wxyz"] = {q[0], q[1], q[2], q[3]};
}

// A list that may be absent from the document; an absent list is empty.
const Json& list_of(const Json& json, const char* key) {
  static const Json none = Json::array();
  return json.contains(key) ? json[key] : none;
}

std::optional<double> optional_of(const Json& json) {
  return json.is_null() ? std::nullopt : std::optional<double>(json.get<double>());
}
Json json_of(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Joint joint_of(const Json& json) {
  Joint joint;
  joint.name = json["name"].get<std::string>();
  joint.type = json["type"] == "revolute" ? JointType::revolute : JointType::prismatic;
  joint.screw = numbers_of<6>(json["screw"]);
  joint.lower = optional_of(json["lower"]);
  joint.upper = optional_of(json["upper"]);
  joint.velocity_max = optional_of(json["velocity_max"]);
  joint.effort_max = optional_of(json["effort_max"]);
  joint.damping = json["damping"].get<double>();
  joint.friction = json.value("friction", 0.0);
  joint.armature = json.value("armature", 0.0);
  return joint;
}

Json json_of(const Joint& joint) {
  Json json{{"name", joint.name},
            {"type", joint.type == JointType::revolute ? "revolute" : "prismatic"}};
  json["screw"] = std::vector<double>(joint.screw.begin(), joint.screw.end());
  json["lower"] = json_of(joint.lower);
  json["upper"] = json_of(joint.upper);
  json["velocity_max"] = json_of(joint.velocity_max);
  json["effort_max"] = json_of(joint.effort_max);
  json["damping"] = joint.damping;
  if (joint.friction != 0.0) json["friction"] = joint.friction;
  if (joint.armature != 0.0) json["armature"] = joint.armature;
  return json;
}

Sphere sphere_of(const Json& json) {
  return {vector_of(json["center_m"]), json["radius_m"].get<double>(), json.value("part", "")};
}

Json json_of(const Sphere& sphere) {
  Json json{{"center_m", json_of(sphere.center_m)}, {"radius_m", sphere.radius_m}};
  if (!sphere.part.empty()) json["part"] = sphere.part;
  return json;
}

Segment segment_of(const Json& json) {
  return {vector_of(json["from_m"]), vector_of(json["to_m"]), json["radius_m"].get<double>(),
          json.value("part", "")};
}

Json json_of(const Segment& segment) {
  Json json{{"from_m", json_of(segment.from_m)},
            {"to_m", json_of(segment.to_m)},
            {"radius_m", segment.radius_m}};
  if (!segment.part.empty()) json["part"] = segment.part;
  return json;
}

Json json_of(const Link& link) {
  const Matrix3d I = model::symmetric_part(link.inertia_kg_m2);
  Json json{{"name", link.name}, {"parent", link.parent}, {"joint", json_of(link.joint)}};
  put_pose(json["com"], link.com);
  json["mass_kg"] = link.mass_kg;
  json["inertia_kg_m2"] = {I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2)};
  json["spheres"] = Json::array();
  for (const auto& sphere : link.spheres) json["spheres"].push_back(json_of(sphere));
  json["segments"] = Json::array();
  for (const auto& segment : link.segments) json["segments"].push_back(json_of(segment));
  return json;
}

// A frame without a link is on the base; one without a name has that of its link.
Frame frame_of(const Json& json, const std::vector<std::string>& links, const std::string& where) {
  Frame frame{json.value("name", ""), -1, pose_of(json, where)};
  if (!json.contains("link")) return frame;
  const auto name = json["link"].get<std::string>();
  const auto at = std::find(links.begin(), links.end(), name);
  if (at == links.end())
    throw Error(ErrorCode::invalid, fmt::format("{}/link: no link '{}', expected one of {}", where,
                                                name, detail::join(links)));
  frame.link = static_cast<int>(at - links.begin());
  if (frame.name.empty()) frame.name = name;
  return frame;
}

Json json_of(const Frame& frame, const Robot& robot) {
  Json json = Json::object();
  std::string moving;
  if (frame.link >= 0) {
    moving = robot.links.at(static_cast<std::size_t>(frame.link)).name;
    json["link"] = moving;
  }
  if (frame.name != moving) json["name"] = frame.name;
  put_pose(json, frame.pose);
  return json;
}

}  // namespace

Robot robot_from_json(const Json& document, const std::string& where) {
  check_shipped_schema(document, "robot", where);
  Robot robot;
  robot.name = document["name"].get<std::string>();
  for (const auto& note : list_of(document, "notes"))
    robot.notes.push_back(note.get<std::string>());
  for (const auto& warning : list_of(document, "warnings"))
    robot.warnings.push_back(warning.get<std::string>());
  std::vector<std::string> names;
  for (const auto& json : document["links"]) {
    const std::string place = fmt::format("{}: /links/{}", where, robot.links.size());
    Link link;
    link.name = json["name"].get<std::string>();
    link.parent = json["parent"].get<int>();
    link.joint = joint_of(json["joint"]);
    const std::string note = detail::normalise_screw(link.joint, place + "/joint");
    if (!note.empty()) robot.notes.push_back(note);
    link.com = pose_of(json["com"], place + "/com");
    link.mass_kg = json["mass_kg"].get<double>();
    const Vector6d I = numbers_of<6>(json["inertia_kg_m2"]);
    link.inertia_kg_m2 << I[0], I[3], I[4], I[3], I[1], I[5], I[4], I[5], I[2];
    for (const auto& sphere : list_of(json, "spheres")) {
      link.spheres.push_back(sphere_of(sphere));
      if (link.spheres.back().part == link.name) link.spheres.back().part.clear();
    }
    for (const auto& segment : list_of(json, "segments")) {
      link.segments.push_back(segment_of(segment));
      if (link.segments.back().part == link.name) link.segments.back().part.clear();
    }
    names.push_back(link.name);
    robot.links.push_back(std::move(link));
  }
  robot.tip = frame_of(document["tip"], names, where + ": /tip");
  for (const auto& json : list_of(document, "frames"))
    robot.frames.push_back(
        frame_of(json, names, fmt::format("{}: /frames/{}", where, robot.frames.size())));
  for (const auto& sphere : list_of(document, "base_spheres"))
    robot.base_spheres.push_back(sphere_of(sphere));
  for (const auto& segment : list_of(document, "base_segments"))
    robot.base_segments.push_back(segment_of(segment));
  for (const auto& pair : list_of(document, "self_collision_disabled"))
    robot.self_collision_disabled.emplace_back(pair[0].get<std::string>(),
                                               pair[1].get<std::string>());
  detail::round_to_quaternions(robot);
  model::check(robot, where);
  for (const Link& link : robot.links)
    detail::check_triangle_inequality(robot, link.name, link.inertia_kg_m2, false, where);
  return robot;
}

Json robot_to_json(const Robot& robot) {
  Json json{{"schema", schema_name}, {"name", robot.name}};
  json["tip"] = json_of(robot.tip, robot);
  json["links"] = Json::array();
  for (const auto& link : robot.links) json["links"].push_back(json_of(link));
  if (!robot.frames.empty()) {
    json["frames"] = Json::array();
    for (const auto& frame : robot.frames) json["frames"].push_back(json_of(frame, robot));
  }
  if (!robot.base_spheres.empty()) {
    json["base_spheres"] = Json::array();
    for (const auto& sphere : robot.base_spheres) json["base_spheres"].push_back(json_of(sphere));
  }
  if (!robot.base_segments.empty()) {
    json["base_segments"] = Json::array();
    for (const auto& segment : robot.base_segments)
      json["base_segments"].push_back(json_of(segment));
  }
  json["self_collision_disabled"] = Json::array();
  for (const auto& [a, b] : robot.self_collision_disabled)
    json["self_collision_disabled"].push_back(Json::array({a, b}));
  if (!robot.notes.empty()) json["notes"] = robot.notes;
  if (!robot.warnings.empty()) json["warnings"] = robot.warnings;
  return json;
}

}  // namespace hamelin::description

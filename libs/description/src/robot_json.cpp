#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "detail.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/io/file.hpp"

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

// One pass of R → quaternion → R.
Matrix3d through_quaternion(const Matrix3d& R) {
  return geometry::rotation_from_wxyz(geometry::quaternion_wxyz(R));
}

Matrix3d rounded(Matrix3d R) {
  // The passes usually converge at once, because of rounding. A rotation that alternates between
  // neighbours is changed by a few roundings, which starts another sequence.
  constexpr int tries = 100, passes = 20;
  constexpr double roundings = 4e-16;
  Rng rng(0);
  for (int attempt = 0; attempt < tries; ++attempt) {
    for (int pass = 0; pass < passes; ++pass) {
      const Matrix3d next = through_quaternion(R);
      if (next == R) return R;
      R = next;
    }
    Eigen::Vector4d q = geometry::quaternion_wxyz(R);
    for (double& component : q) component += rng.uniform(-roundings, roundings);
    R = geometry::rotation_from_wxyz(q);
  }
  return R;
}

// Reads a sidecar with collision shapes; messages name the place in the document.
class SidecarReader {
 public:
  explicit SidecarReader(const std::string& where) : where_(where) {}

  detail::SphereFile read(const Json& document) const {
    if (!document.is_object() || !document.contains("links") || !document["links"].is_object())
      fail("expected an object whose \"links\" maps link names to lists of spheres");
    detail::SphereFile out;
    out.where = where_;
    for (const auto& [name, list] : document["links"].items())
      out.links[name] = spheres(list, "/links/" + name);
    if (document.contains("capsules")) {
      if (!document["capsules"].is_object())
        fail("/capsules: expected an object that maps link names to capsules");
      for (const auto& [name, list] : document["capsules"].items())
        out.capsules[name] = capsules(list, "/capsules/" + name);
    }
    if (document.contains("self_collision_disabled"))
      out.self_collision_disabled = pairs(document["self_collision_disabled"]);
    return out;
  }

 private:
  [[noreturn]] void fail(const std::string& message) const {
    throw Error(ErrorCode::invalid, fmt::format("{}: {}", where_, message));
  }
  [[nodiscard]] double number(const Json& value, const std::string& place) const {
    if (!value.is_number()) fail(fmt::format("{}: expected a number", place));
    return value.get<double>();
  }
  [[nodiscard]] Vector3d point(const Json& value, const std::string& place) const {
    return {number(value[0], place), number(value[1], place), number(value[2], place)};
  }
  [[nodiscard]] double radius(const Json& value, const std::string& place) const {
    const double r = number(value, place + "/radius");
    if (!(r > 0.0)) fail(fmt::format("{}/radius: {} m, expected a positive number", place, r));
    return r;
  }
  static bool has_point(const Json& shape, const char* key) {
    return shape.contains(key) && shape[key].is_array() && shape[key].size() == 3;
  }

  [[nodiscard]] std::vector<Sphere> spheres(const Json& list, const std::string& where) const {
    if (!list.is_array()) fail(where + ": expected a list of spheres");
    std::vector<Sphere> out;
    for (const Json& sphere : list) {
      const std::string place = fmt::format("{}/{}", where, out.size());
      if (!sphere.is_object() || sphere.size() != 2 || !has_point(sphere, "center") ||
          !sphere.contains("radius"))
        fail(fmt::format("{}: expected {{\"center\": [x, y, z], \"radius\": r}}", place));
      out.push_back({point(sphere["center"], place + "/center"), radius(sphere["radius"], place)});
    }
    return out;
  }

  [[nodiscard]] std::vector<Segment> capsules(const Json& list, const std::string& where) const {
    if (!list.is_array()) fail(where + ": expected a list of capsules");
    std::vector<Segment> out;
    for (const Json& capsule : list) {
      const std::string place = fmt::format("{}/{}", where, out.size());
      if (!capsule.is_object() || capsule.size() != 3 || !has_point(capsule, "from") ||
          !has_point(capsule, "to") || !capsule.contains("radius"))
        fail(fmt::format("{}: expected {{\"from\": [x, y, z], \"to\": [x, y, z], \"radius\": r}}",
                         place));
      out.push_back({point(capsule["from"], place + "/from"), point(capsule["to"], place + "/to"),
                     radius(capsule["radius"], place)});
    }
    return out;
  }

  [[nodiscard]] std::vector<std::pair<std::string, std::string>> pairs(const Json& list) const {
    constexpr const char* expected =
        "/self_collision_disabled: expected a list of pairs of link names";
    if (!list.is_array()) fail(expected);
    std::vector<std::pair<std::string, std::string>> out;
    for (const Json& pair : list) {
      if (!pair.is_array() || pair.size() != 2 || !pair[0].is_string() || !pair[1].is_string())
        fail(expected);
      out.emplace_back(pair[0].get<std::string>(), pair[1].get<std::string>());
    }
    return out;
  }

  const std::string& where_;
};

void replace_shapes(Robot& robot, const detail::SphereFile& given) {
  std::vector<std::string> names;
  for (auto& link : robot.links) {
    link.spheres.clear();
    auto& segments = link.segments;
    segments.erase(std::remove_if(segments.begin(), segments.end(),
                                  [](const Segment& s) { return s.is_capsule(); }),
                   segments.end());
    names.push_back(link.name);
  }
  robot.base_spheres.clear();
  robot.base_segments.clear();
  // Pairs that name parts of the replaced shapes are dropped; the sidecar of a JSON robot names
  // links only.
  const auto names_removed_part = [&](const auto& pair) {
    return std::find(names.begin(), names.end(), pair.first) == names.end() ||
           std::find(names.begin(), names.end(), pair.second) == names.end();
  };
  auto& disabled = robot.self_collision_disabled;
  disabled.erase(std::remove_if(disabled.begin(), disabled.end(), names_removed_part),
                 disabled.end());
  const auto link_named = [&](const std::string& name) -> Link& {
    for (auto& link : robot.links)
      if (link.name == name) return link;
    throw Error(ErrorCode::invalid, fmt::format("{}: the robot has no link '{}'{}", given.where,
                                                name, did_you_mean(name, names)));
  };
  for (const auto& [name, spheres] : given.links) link_named(name).spheres = spheres;
  for (const auto& [name, capsules] : given.capsules) {
    auto& segments = link_named(name).segments;
    segments.insert(segments.end(), capsules.begin(), capsules.end());
  }
  for (const auto& [a, b] : given.self_collision_disabled)
    robot.self_collision_disabled.emplace_back(link_named(a).name, link_named(b).name);
}

// Adds the pairs whose parts this robot has. A JSON robot may lack links of the URDF for which the
// SRDF was written.
void apply_srdf(Robot& robot, const std::filesystem::path& file) {
  std::vector<std::string> parts;
  const auto add = [&](const auto& shapes) {
    for (const auto& shape : shapes) parts.push_back(shape.part);
  };
  for (const Link& link : robot.links) {
    parts.push_back(link.name);
    add(link.spheres);
    add(link.segments);
  }
  add(robot.base_spheres);
  add(robot.base_segments);
  const auto known = [&](const std::string& name) {
    return std::find(parts.begin(), parts.end(), name) != parts.end();
  };
  std::vector<DisabledPair> pairs = read_srdf(file);
  const std::size_t all = pairs.size();
  pairs.erase(std::remove_if(pairs.begin(), pairs.end(),
                             [&](const DisabledPair& pair) {
                               return !known(pair.link_a) || !known(pair.link_b);
                             }),
              pairs.end());
  std::string note = detail::merge_pairs(robot.self_collision_disabled, pairs, file.filename());
  if (pairs.size() < all)
    note += fmt::format("; {} more name links that this robot does not have", all - pairs.size());
  robot.notes.push_back(note);
}

// The tip and a frame change places.
void choose_tip(Robot& robot, const std::string& name, const std::string& where) {
  std::vector<std::string> names{robot.tip.name};
  for (Frame& frame : robot.frames) {
    if (frame.link < 0) continue;
    if (frame.name == name) return std::swap(frame, robot.tip);
    names.push_back(frame.name);
  }
  throw Error(ErrorCode::invalid,
              fmt::format("{}: no frame '{}' on a moving link for the tip, expected one of {}",
                          where, name, detail::join(names)));
}

}  // namespace

std::string detail::join(const std::vector<std::string>& names) {
  return fmt::format("{}", fmt::join(names, ", "));
}

void detail::check_triangle_inequality(Robot& robot, const std::string& link,
                                       const Matrix3d& inertia, bool strict,
                                       const std::string& where) {
  const std::string fault = model::triangle_fault(inertia);
  if (fault.empty()) return;
  if (strict)
    throw Error(ErrorCode::invalid, fmt::format("{}: link '{}': inertia {}", where, link, fault));
  const std::string warning =
      fmt::format("link '{}': inertia {}; it is used as given", link, fault);
  if (std::find(robot.warnings.begin(), robot.warnings.end(), warning) == robot.warnings.end())
    robot.warnings.push_back(warning);
}

void detail::round_to_quaternions(Robot& robot) {
  const auto round = [](const SE3& pose) { return SE3(rounded(pose.R()), pose.p()); };
  for (auto& link : robot.links) link.com = round(link.com);
  robot.tip.pose = round(robot.tip.pose);
  for (auto& frame : robot.frames) frame.pose = round(frame.pose);
}

std::string detail::normalise_screw(Joint& joint, const std::string& where) {
  constexpr double rounding = 1e-14;  // a vector that is a unit vector to within this is kept
  constexpr double worth_a_note = 1e-6;
  const double length = joint.type == JointType::revolute ? joint.screw.head<3>().norm()
                                                          : joint.screw.tail<3>().norm();
  if (!(length > 1e-9 && length < 1e9))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: the axis has length {}, expected a direction", where, length));
  if (std::abs(length - 1.0) > rounding) joint.screw /= length;
  if (std::abs(length - 1.0) <= worth_a_note) return {};
  return fmt::format("joint '{}': its axis had length {:.6g} and was normalised", joint.name,
                     length);
}

std::size_t check_spheres(const std::filesystem::path& file) {
  const detail::SphereFile given = detail::read_spheres(read_json(file), file.string());
  std::size_t count = 0;
  for (const auto& [name, spheres] : given.links) count += spheres.size();
  for (const auto& [name, capsules] : given.capsules) count += capsules.size();
  return count;
}

detail::SphereFile detail::read_spheres(const Json& document, const std::string& where) {
  return SidecarReader(where).read(document);
}

std::optional<detail::SphereFile> detail::sidecar_of(const RobotOptions& options) {
  if (options.sidecar) return read_spheres(*options.sidecar, "sidecar");
  if (options.spheres) return read_spheres(read_json(*options.spheres), options.spheres->string());
  return std::nullopt;
}

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

Robot read_robot(const std::filesystem::path& file, const RobotOptions& options) {
  const std::string where = file.string(), extension = file.extension().string();
  const std::string text = read_file(file);
  if (extension == ".urdf") return detail::read_urdf(text, where, options);
  if (extension != ".json")
    throw Error(ErrorCode::usage,
                fmt::format("{}: unknown kind of robot file '{}', expected .urdf or .json", where,
                            extension));
  Robot robot = robot_from_json(parse_json(text, where), where);
  if (options.strict)
    for (const Link& link : robot.links)
      detail::check_triangle_inequality(robot, link.name, link.inertia_kg_m2, true, where);
  if (options.tip && *options.tip != robot.tip.name) choose_tip(robot, *options.tip, where);
  if (const auto sidecar = detail::sidecar_of(options)) {
    replace_shapes(robot, *sidecar);
    model::check(robot, sidecar->where);
  }
  if (options.srdf) {
    apply_srdf(robot, *options.srdf);
    model::check(robot, options.srdf->string());
  }
  return robot;
}

}  // namespace hamelin::description

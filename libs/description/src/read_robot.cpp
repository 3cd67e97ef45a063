#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "detail.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"

namespace hamelin::description {

namespace {

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

#pragma once
#include <filesystem>
#include <optional>
#include <string>

#include "hamelin/io/json.hpp"
#include "hamelin/model/robot.hpp"

namespace hamelin::description {

/// Choices that a robot file leaves to its reader.
struct RobotOptions {
  /// Name of the tip. URDF: any link, by default the only leaf. JSON: the file's tip, or one of its
  /// frames on a moving link.
  std::optional<std::string> tip;
  /// Sidecar, a JSON file with collision shapes that replace those of the robot file. "links" maps
  /// names of links to spheres, [{"center": [x, y, z], "radius": r}, ...]; the optional "capsules"
  /// maps them to [{"from": [x, y, z], "to": [x, y, z], "radius": r}, ...]; the optional
  /// "self_collision_disabled" lists pairs of links. Lengths are in metres, in the link's frame
  /// (URDF) or its COM frame (JSON robots).
  std::optional<std::filesystem::path> spheres;
  /// SRDF whose disabled pairs are added to those of the sidecar and of the robot file (see
  /// srdf.hpp). For a URDF each link that it names must exist. A JSON robot does not have all links
  /// of the URDF that it was made from; pairs of unknown links are skipped.
  std::optional<std::filesystem::path> srdf{};
  /// Refuse inertias that break the triangle inequality instead of noting a warning.
  bool strict = false;
  /// The content of a sidecar that is not in a file; it takes precedence over `spheres`.
  std::optional<Json> sidecar{};
};

/// Reads a robot from a .urdf or a .json file (schema "robot") and checks it. `notes` lists what
/// was lumped, locked or skipped.
/// @throws Error io, parse or invalid: "file: place: what is wrong, what was expected"
[[nodiscard]] model::Robot read_robot(const std::filesystem::path& file,
                                      const RobotOptions& options = {});

/// Checks a sidecar with collision shapes by itself. Whether its link names exist can only be
/// checked with its robot.
/// @return the number of spheres and capsules in it
/// @throws Error io, parse or invalid, as read_robot
[[nodiscard]] std::size_t check_spheres(const std::filesystem::path& file);

/// A self-contained description, of schema "robot". Reading it back gives the same robot bit for
/// bit if the robot came from read_robot, robot_from_json or make_chain; otherwise its rotations
/// are rounded to quaternions. Rotations without a quaternion of doubles that reproduces them
/// change by about 1e-16.
[[nodiscard]] Json robot_to_json(const model::Robot& robot);

/// @param where name of the document's source (a file), prefix of error messages
/// @throws Error invalid
[[nodiscard]] model::Robot robot_from_json(const Json& document, const std::string& where);

}  // namespace hamelin::description

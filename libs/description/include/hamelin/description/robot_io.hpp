#pragma once
#include <filesystem>
#include <optional>
#include <string>

#include "hamelin/io/json.hpp"
#include "hamelin/model/robot.hpp"

namespace hamelin::description {

/// What a robot file leaves open.
struct RobotOptions {
  /// Name of the tip. URDF: any link; default: the only leaf. JSON: must be the file's own tip.
  std::optional<std::string> tip;
  /// Sidecar with collision shapes, which replace the file's own: an object whose "links" maps a link's name to
  /// spheres, [{"center": [x, y, z], "radius": r}, ...] in metres, in the link's frame (URDF) or its COM frame (JSON
  /// robots), whose optional "capsules" maps it to [{"from": [x, y, z], "to": [x, y, z], "radius": r}, ...], and whose
  /// optional "self_collision_disabled" lists pairs of links.
  std::optional<std::filesystem::path> spheres;
  /// SRDF whose disabled pairs join those of the sidecar and of the file (see srdf.hpp). URDF: each link it names must
  /// exist; of a JSON robot, which does not know all links of what it was made from, unknown pairs are passed over.
  std::optional<std::filesystem::path> srdf{};
  /// Refuse inertias against the triangle inequality instead of noting a warning.
  bool strict = false;
  /// The content of such a sidecar, where it is in no file (yet); `spheres` then does not count.
  std::optional<Json> sidecar{};
};

/// Reads a robot from a .urdf or a .json file (schema "robot") and checks it. What was lumped, locked or skipped stands
/// in `notes`.
/// @throws Error io, parse or invalid: "file: place: what is wrong, what was expected"
[[nodiscard]] model::Robot read_robot(const std::filesystem::path& file, const RobotOptions& options = {});

/// Checks a sidecar with collision shapes by itself: whether its link names fit shows only with its robot.
/// @return how many spheres and capsules it holds
/// @throws Error io, parse or invalid, as read_robot
[[nodiscard]] std::size_t check_spheres(const std::filesystem::path& file);

/// A self-contained description, of schema "robot". Reading it back gives the same robot, bit for bit, if the robot
/// came from read_robot, robot_from_json or make_chain (else its rotations are rounded to quaternions). Some rotations
/// have no quaternion of doubles that leads back to them: those move by some 1e-16.
[[nodiscard]] Json robot_to_json(const model::Robot& robot);

/// @param where opens the error messages (a file name)
/// @throws Error invalid
[[nodiscard]] model::Robot robot_from_json(const Json& document, const std::string& where);

}  // namespace hamelin::description

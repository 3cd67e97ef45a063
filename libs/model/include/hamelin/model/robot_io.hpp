#pragma once
#include <filesystem>
#include <optional>
#include <string>

#include "hamelin/core/json.hpp"
#include "hamelin/model/robot.hpp"

namespace hamelin::model {

/// What a robot file leaves open.
struct RobotOptions {
  /// Name of the tip. URDF: any link; default: the only leaf. JSON: must be the file's own tip.
  std::optional<std::string> tip;
  /// Sidecar with collision spheres, which replace the file's own: an object whose "links" maps a link's name to
  /// [{"center": [x, y, z], "radius": r}, ...] in metres, in the link's frame (URDF) or its COM frame (JSON robots),
  /// and whose optional "self_collision_disabled" lists pairs of links.
  std::optional<std::filesystem::path> spheres;
};

/// Reads a robot from a .urdf or a .json file (schema "robot") and checks it. What was lumped, locked or skipped stands
/// in `notes`.
/// @throws Error io, parse or invalid: "file: place: what is wrong, what was expected"
[[nodiscard]] Robot read_robot(const std::filesystem::path& file, const RobotOptions& options = {});

/// Checks a sidecar with collision spheres by itself: whether its link names fit shows only with its robot.
/// @return how many spheres it holds
/// @throws Error io, parse or invalid, as read_robot
[[nodiscard]] std::size_t check_spheres(const std::filesystem::path& file);

/// A self-contained description, of schema "robot". Reading it back gives the same robot, bit for bit, if the robot
/// came from read_robot, robot_from_json or make_chain (else its rotations are rounded to quaternions).
[[nodiscard]] Json robot_to_json(const Robot& robot);

/// @param where opens the error messages (a file name)
/// @throws Error invalid
[[nodiscard]] Robot robot_from_json(const Json& document, const std::string& where);

}  // namespace hamelin::model

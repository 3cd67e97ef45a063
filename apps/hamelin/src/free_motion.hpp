#pragma once
#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>

#include "hamelin/scene/scene.hpp"

/// Shared by `hamelin integrate` and `hamelin accuracy`: the robot in free motion and its start.
namespace hamelin::app {

struct MotionFlags {
  std::filesystem::path file;
  std::optional<std::string> tip, q0, v0;
};

void add_motion_flags(CLI::App& command, MotionFlags& flags);

/// Reads a scene and notes which parts of it free motion ignores. A robot file gives a scene with
/// all defaults and gravity -9.81 m/s^2 along z.
/// @throws Error invalid for a file that is neither
[[nodiscard]] scene::Scene read_motion(const MotionFlags& flags);

/// Writes --q0 and --v0 into the scene. @throws Error usage if there are not `dof` values
void set_start(const MotionFlags& flags, int dof, scene::Scene& scene);

}  // namespace hamelin::app

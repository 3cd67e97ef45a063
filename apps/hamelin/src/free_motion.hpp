#pragma once
#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>

#include "hamelin/scene/scene.hpp"

/// What `hamelin integrate` and `hamelin accuracy` share: which arm falls, and from where.
namespace hamelin::app {

struct MotionFlags {
  std::filesystem::path file;
  std::optional<std::string> tip, q0, v0;
};

void add_motion_flags(CLI::App& command, MotionFlags& flags);

/// The scene, saying what of it is ignored; for a bare robot one with all defaults, gravity -9.81 m/s^2 along z.
/// @throws Error invalid for a file that is neither
[[nodiscard]] scene::Scene read_motion(const MotionFlags& flags);

/// Puts --q0 and --v0 into the scene. @throws Error usage if there are not `dof` numbers
void set_start(const MotionFlags& flags, int dof, scene::Scene& scene);

}  // namespace hamelin::app

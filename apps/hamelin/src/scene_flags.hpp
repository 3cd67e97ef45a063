#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/scene/scene.hpp"

namespace hamelin::app {

/// What a command line may change in a scene file.
struct SceneFlags {
  std::optional<std::string> planner, integrator;
  std::optional<double> step_s, duration_s;
  std::optional<std::uint64_t> seed;
  std::vector<std::string> set;  ///< "/json/pointer=VALUE", applied last
};

/// The scene with the flags written into its document, so that its own checks speak for them.
/// @throws Error as scene::scene_from_json does, and for a file that is no scene
[[nodiscard]] scene::Scene read_scene(const std::filesystem::path& file, const SceneFlags& flags);

/// The files that a scene is made of.
[[nodiscard]] std::vector<std::filesystem::path> files_of(const scene::Scene& scene);

}  // namespace hamelin::app

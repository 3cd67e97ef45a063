#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/scene/overrides.hpp"

namespace CLI {
class App;
}

namespace hamelin::app {

/// Values of a scene file that the command line overrides.
using SceneFlags = scene::Overrides;

/// Reads a scene after writing the flags into its JSON document, whose checks then cover them.
/// @throws Error like scene::scene_from_json, and for a file that is not a scene
[[nodiscard]] scene::Scene read_scene(const std::filesystem::path& file, const SceneFlags& flags);

/// Writes the flags into the document of a scene, before it is checked.
/// @param where prefix of messages
void apply_flags(const SceneFlags& flags, Json& document, const std::string& where);

/// Adds --set, whose assignments scene::set_pointer() takes.
void add_set_option(CLI::App& command, std::vector<std::string>& set, const std::string& help);

/// Adds --seed.
void add_seed_option(CLI::App& command, SceneFlags& flags);

/// Adds --guide.
void add_guide_option(CLI::App& command, SceneFlags& flags);

/// The scene file and the files that it names.
[[nodiscard]] std::vector<std::filesystem::path> files_of(const scene::Scene& scene);

}  // namespace hamelin::app

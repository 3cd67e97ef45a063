#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::app {

struct PluginCheck {
  std::string name;
  std::string failure;  ///< empty: passed
};

struct PluginCheckOptions {
  std::vector<std::filesystem::path> scenes;  ///< in which it is tried, besides the built-in ones
  std::optional<double> deadline_s;           ///< none: that of each scene
};

/// The scenes of data/ that a check uses: those installed with the program, else those below the
/// working directory.
[[nodiscard]] std::vector<std::filesystem::path> installed_scenes();

/// Tests a loaded plugin against the contract of the plugin interface: its schema and the range of
/// its parameters; valid answers in several scenes, while goals and obstacles change; what it
/// declares about memory and threads; equal answers in equal runs; its time. Each part runs in a
/// process of its own, so that a crash is a failure like any other.
[[nodiscard]] std::vector<PluginCheck> check_plugin(const planning::Plugin& plugin,
                                                    const PluginCheckOptions& options);

}  // namespace hamelin::app

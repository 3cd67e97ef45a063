#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::app {

struct PluginCheck {
  enum class Outcome { ok, failed, skipped };
  Outcome outcome;
  std::string name;
  std::string text;  ///< what is wrong and what was expected; why it is skipped; or a remark
};

struct PluginCheckOptions {
  std::vector<std::filesystem::path> scenes;  ///< in which it is tried, besides the built-in ones
  std::optional<double> deadline_s;           ///< none: that of each scene
  double timeout_s = 120.0;                   ///< wall time for each part
};

/// The scenes of a checkout of hamelin in the working directory; elsewhere none.
[[nodiscard]] std::vector<std::filesystem::path> scenes_of_checkout();

/// Tests a loaded plugin against the contract of the plugin interface: its schema and the range of
/// its parameters; valid answers in several scenes, while goals and obstacles change; what it
/// declares about memory and threads; equal answers in equal runs; its time. Each part runs in a
/// process of its own, so that a crash is a failure like any other.
/// @throws Error for a scene that cannot be read
[[nodiscard]] std::vector<PluginCheck> check_plugin(const planning::Plugin& plugin,
                                                    const PluginCheckOptions& options);

}  // namespace hamelin::app

#pragma once
#include <string>
#include <vector>

#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::app {

struct PluginCheck {
  std::string what;
  std::string failure;  ///< empty: passed
};

/// Tries a loaded plugin: its schema and defaults, a planner for each kind of goal on a two-link arm, ticks at rest, in
/// motion and next to an obstacle, and that equal ticks give equal answers.
[[nodiscard]] std::vector<PluginCheck> check_plugin(const planning::Plugin& plugin);

}  // namespace hamelin::app

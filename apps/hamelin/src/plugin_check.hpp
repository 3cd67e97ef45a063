#pragma once
#include <string>
#include <vector>

#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::app {

struct PluginCheck {
  std::string name;
  std::string failure;  ///< empty: passed
};

/// Tests a loaded plugin: its schema and defaults, and a planner for each kind of goal on a
/// two-link arm, with ticks at rest, in motion and next to an obstacle. Equal ticks must give equal
/// answers.
[[nodiscard]] std::vector<PluginCheck> check_plugin(const planning::Plugin& plugin);

}  // namespace hamelin::app

#pragma once
#include <CLI/CLI.hpp>

/// Subcommands of `hamelin robot` that have a file of their own.
namespace hamelin::app {

/// What --strict does, wherever a robot is checked.
inline constexpr const char* strict_help = "refuse inertias against the triangle inequality instead of warning";

void add_robot_fit(CLI::App& robot, int& exit_code);
void add_robot_check(CLI::App& robot, int& exit_code);

}  // namespace hamelin::app

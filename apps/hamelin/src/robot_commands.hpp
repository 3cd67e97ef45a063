#pragma once
#include <CLI/CLI.hpp>

/// Subcommands of `hamelin robot` that are defined in separate source files.
namespace hamelin::app {

/// The help text of --strict in every command that checks a robot.
inline constexpr const char* strict_help =
    "refuse inertias that violate the triangle inequality instead of warning";

void add_robot_fit(CLI::App& robot, int& exit_code);
void add_robot_check(CLI::App& robot, int& exit_code);
void add_robot_identify(CLI::App& robot, int& exit_code);

}  // namespace hamelin::app

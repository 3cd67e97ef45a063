#pragma once
#include <CLI/CLI.hpp>

/// Subcommands of `hamelin robot` that have a file of their own.
namespace hamelin::app {

void add_robot_fit(CLI::App& robot, int& exit_code);
void add_robot_check(CLI::App& robot, int& exit_code);

}  // namespace hamelin::app

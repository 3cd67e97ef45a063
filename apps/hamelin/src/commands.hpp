#pragma once
#include <CLI/CLI.hpp>

/// The subcommands: each function adds one. Its action runs after the command line is parsed and
/// sets the exit code.
namespace hamelin::app {

void add_run(CLI::App& app, int& exit_code);
void add_task(CLI::App& app, int& exit_code);
void add_plan(CLI::App& app, int& exit_code);
void add_optimize(CLI::App& app, int& exit_code);
void add_integrate(CLI::App& app, int& exit_code);
void add_accuracy(CLI::App& app, int& exit_code);
void add_replay(CLI::App& app, int& exit_code);
void add_explain(CLI::App& app, int& exit_code);
void add_export(CLI::App& app, int& exit_code);
void add_report(CLI::App& app, int& exit_code);
void add_serve(CLI::App& app, int& exit_code);
void add_plant(CLI::App& app, int& exit_code);
void add_robot(CLI::App& app, int& exit_code);
void add_scene(CLI::App& app, int& exit_code);
void add_map(CLI::App& app, int& exit_code);
void add_sweep(CLI::App& app, int& exit_code);
void add_bench(CLI::App& app, int& exit_code);
void add_plugins(CLI::App& app, int& exit_code);
void add_validate(CLI::App& app, int& exit_code);
void add_schema(CLI::App& app, int& exit_code);
void add_help(CLI::App& app, int& exit_code);
void add_completion(CLI::App& app, int& exit_code);
/// Hidden from help: the build uses it to write the manual pages.
void add_man(CLI::App& app, int& exit_code);

}  // namespace hamelin::app

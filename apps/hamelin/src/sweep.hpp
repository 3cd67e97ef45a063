#pragma once
#include <CLI/CLI.hpp>
#include <filesystem>
#include <vector>

#include "hamelin/sweep/run_sweep.hpp"

/// The subcommands of `hamelin sweep`.
namespace hamelin::app {

void add_sweep_plan(CLI::App& sweep, int& exit_code);
void add_sweep_run(CLI::App& sweep, int& exit_code);
void add_sweep_merge(CLI::App& sweep, int& exit_code);
void add_sweep_compare(CLI::App& sweep, int& exit_code);
void add_sweep_emit(CLI::App& sweep, int& exit_code);
void add_sweep_pack(CLI::App& sweep, int& exit_code);
void add_sweep_unpack(CLI::App& sweep, int& exit_code);
void add_sweep_pairs(CLI::App& sweep, int& exit_code);
/// Hidden from help: one run under the judge, printed as a line of JSON. Sweeps and benchmarks call
/// it.
void add_sweep_one(CLI::App& sweep, int& exit_code);

/// Sets the options so that each run calls `hamelin sweep one` in a fork of this process. The
/// program is not loaded again, and may have been rebuilt since it was started.
/// @param plugin_directories  directories to search first for planners
void run_in_forks(sweep::RunOptions& options,
                  const std::vector<std::filesystem::path>& plugin_directories);

}  // namespace hamelin::app

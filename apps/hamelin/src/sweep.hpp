#pragma once
#include <CLI/CLI.hpp>

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
/// Hidden from help: one run under the judge, printed as a line of JSON. `sweep run` starts it.
void add_sweep_one(CLI::App& sweep, int& exit_code);

}  // namespace hamelin::app

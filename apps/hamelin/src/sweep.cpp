#include "sweep.hpp"

#include "command_line.hpp"
#include "commands.hpp"

namespace hamelin::app {

namespace {

void add_sweep(CLI::App& app, int& exit_code) {
  auto* sweep = add_command(
      app, "sweep", "Plan and run many scenes, and summarise the results",
      "hamelin sweep plan data/scenes/shelf.json --planner hybrid --planner apf -o tries\n"
      "hamelin sweep run tries\n"
      "hamelin sweep merge tries --page tries.html");
  sweep->require_subcommand(1);
  add_sweep_plan(*sweep, exit_code);
  add_sweep_run(*sweep, exit_code);
  add_sweep_merge(*sweep, exit_code);
  add_sweep_compare(*sweep, exit_code);
  add_sweep_emit(*sweep, exit_code);
  add_sweep_pack(*sweep, exit_code);
  add_sweep_unpack(*sweep, exit_code);
  add_sweep_pairs(*sweep, exit_code);
  add_sweep_one(*sweep, exit_code);
}

const RegisteredCommand registered_sweep("sweep", add_sweep);

}  // namespace

}  // namespace hamelin::app

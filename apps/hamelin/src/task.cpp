#include "hamelin/task/task.hpp"

#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "document.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/simulation/run.hpp"
#include "output.hpp"
#include "plants.hpp"
#include "record.hpp"
#include "scene_flags.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

struct TaskOptions {
  std::filesystem::path file;
  SceneFlags flags;
  std::vector<std::filesystem::path> plugin_path;
  std::optional<std::filesystem::path> output;
  bool plan_only = false;
  RecordOptions record;
};

task::Task read_task(const TaskOptions& options) {
  const std::string where = options.file.string();
  if (const Kind kind = kind_of(options.file); kind != Kind::task)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: is a {}, expected a task", where, to_string(kind)));
  Json document = read_json(options.file);
  if (document.contains("scene")) apply_flags(options.flags, document["scene"], where + ": /scene");
  // A scene that is written elsewhere names its files from anywhere.
  const auto folder = options.output ? std::filesystem::absolute(options.file).parent_path()
                                     : options.file.parent_path();
  return task::task_from_json(document, folder, where);
}

std::string plan_text(const task::TaskPlan& plan) {
  std::string text;
  for (std::size_t i = 0; i < plan.steps.size(); ++i)
    text += fmt::format("{:<12}{}\n", fmt::format("step {}", i + 1), plan.steps[i]);
  if (!plan.found())
    text += fmt::format("{:<12}{}\n", coloured("no plan", Colour::bad), plan.cause);
  return text;
}

int task(const TaskOptions& options) {
  const task::Task given = read_task(options);
  std::optional<std::filesystem::path> target;
  if (options.output) target = output_target(*options.output, files_of(given.scene));
  const task::TaskPlan plan = task::plan_task(given);
  if (!options.record.json || !plan.found()) report(plan_text(plan));
  if (!plan.found()) return 1;
  if (target) write_file_atomically(*target, scene::resolved_json(plan.scene).dump(1) + "\n");
  if (options.plan_only) return 0;
  return record(options.record, files_of(given.scene), [&](const simulation::Watch& watch) {
    return simulation::run(plan.scene, plugin_path(options.plugin_path), watch, plant_factory());
  });
}

void add_task(CLI::App& app, int& exit_code) {
  auto* command =
      add_command(app, "task",
                  "Pick objects up and put them down, by grasps and ways that it finds. The exit "
                  "code is 1 if a step cannot be done",
                  "hamelin task data/tasks/table.json --log table.jsonl.zst\n"
                  "hamelin task data/tasks/shelf.json --plant mujoco\n"
                  "hamelin task data/tasks/shelf.json --plan-only -o scene.json");
  const auto options = std::make_shared<TaskOptions>();
  command->add_option("task", options->file, "task file")->required()->type_name("TASK.json");
  command
      ->add_option("--planner", options->flags.planner,
                   "planner plugin, by name or path (default the scene's)")
      ->type_name("NAME|PATH");
  restrict_values(command->add_option("--plant", options->flags.plant,
                                      "what simulates the arm, as of run (default the scene's, or "
                                      "hamelin)"),
                  {"hamelin", "mujoco"});
  command
      ->add_option("--duration", options->flags.duration_s,
                   "longest simulated time [s] (default the scene's, or 60)")
      ->type_name("T");
  add_seed_option(*command, options->flags);
  add_set_option(*command, options->flags.set,
                 "set one value of the task's scene, e.g. /planner/params/gain=2; may be repeated");
  add_plugin_path_option(*command, options->plugin_path);
  command->add_flag("--plan-only", options->plan_only, "choose grasps and ways, and do not run");
  command->add_option("-o,--output", options->output, "scene file to write, for hamelin run")
      ->type_name("FILE");
  add_record_options(*command, options->record);
  command->callback([options, &exit_code] { exit_code = task(*options); });
}

const RegisteredCommand registered_task("task", add_task);

}  // namespace

}  // namespace hamelin::app

#include <fmt/format.h>

#include <iostream>
#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/simulation/run.hpp"
#include "plants.hpp"
#include "record.hpp"
#include "robot_notes.hpp"
#include "scene_flags.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

struct RunOptions {
  std::filesystem::path file;
  SceneFlags flags;
  std::vector<std::filesystem::path> plugin_path;
  std::optional<std::string> target;  ///< a file, or - for standard input
  std::optional<std::filesystem::path> trajectory;
  bool print_config = false;
  RecordOptions record;
};

// Notes resistance and inertia of joints that the robot file states and the scene does not model.
// The run itself notes what is modelled.
void note_unmodelled(const scene::Scene& scene, const model::Robot& robot) {
  const auto any = [&](auto&& has) {
    return std::any_of(robot.links.begin(), robot.links.end(), has);
  };
  std::vector<const char*> unused;
  if (!scene.model.joint_damping.from_robot &&
      any([](const model::Link& l) { return l.joint.damping != 0.0; }))
    unused.push_back("damping");
  if (!scene.model.friction.from_robot &&
      any([](const model::Link& l) { return l.joint.friction != 0.0; }))
    unused.push_back("friction");
  if (!scene.model.armature.from_robot &&
      any([](const model::Link& l) { return l.joint.armature != 0.0; }))
    unused.push_back("armature");
  if (!unused.empty())
    note(fmt::format("{}: the scene does not model {}", scene.robot.file.string(),
                     fmt::join(unused, ", ")));
}

int run(const RunOptions& options) {
  scene::Scene scene = read_scene(options.file, options.flags);
  if (options.trajectory) scene.goals = {scene::trajectory_goal(*options.trajectory)};
  if (options.target && *options.target != "-")  // the run itself reads standard input
    scene::set_target_file(scene, *options.target, "--target " + *options.target);
  if (options.print_config) {
    print_json(simulation::full_config(scene, plugin_path(options.plugin_path)));
    return 0;
  }
  const model::Model model = control::load_model(scene);
  note_warnings(model.robot(), scene.robot.file);
  note_unmodelled(scene, model.robot());
  return record(options.record, files_of(scene), [&](simulation::Watch watch) {
    if (options.target == "-") watch.target = &std::cin;
    return simulation::run(scene, plugin_path(options.plugin_path), watch, plant_factory());
  });
}

void add_run(CLI::App& app, int& exit_code) {
  auto* command =
      add_command(app, "run", "Move the arm of a scene to its goals with a planner, in closed loop",
                  "hamelin run data/scenes/shelf.json --log shelf.jsonl --result shelf.json\n"
                  "hamelin run data/scenes/clutter.json --planner apf --duration 5\n"
                  "hamelin run data/scenes/shelf.json --set /planner/params/cruise_speed=1 --log "
                  "slow.jsonl.zst");
  const auto options = std::make_shared<RunOptions>();
  command->add_option("scene", options->file, "scene file")->required()->type_name("SCENE.json");
  command
      ->add_option(
          "--planner", options->flags.planner,
          "planner plugin, by name or path, or python:FILE:CLASS, a class in a Python file "
          "(default the scene's)")
      ->type_name("NAME|PATH");
  add_guide_option(*command, options->flags);
  restrict_to_integrators(
      command->add_option("--integrator", options->flags.integrator,
                          "time integrator (default the scene's, or hamel-variational)"));
  restrict_values(
      command->add_option("--plant", options->flags.plant,
                          "what simulates the arm: hamelin, or MuJoCo, which also counts contacts "
                          "itself and implies sampled actuation where the scene has the ideal one "
                          "(default the scene's, or hamelin)"),
      {"hamelin", "mujoco"});
  command->add_option("--step", options->flags.step_s, "time step [s] (default the scene's)")
      ->type_name("H");
  command
      ->add_option("--duration", options->flags.duration_s,
                   "longest simulated time [s] (default the scene's)")
      ->type_name("T");
  add_seed_option(*command, options->flags);
  add_set_option(*command, options->flags.set,
                 "set one value of the scene, e.g. /planner/params/gain=2; may be repeated");
  add_plugin_path_option(*command, options->plugin_path);
  command
      ->add_option("--target", options->target,
                   "follow the targets of a file, or of standard input (-): JSON lines with time_s "
                   "and position_m, quaternion_wxyz, or velocity_m_s, angular_velocity_rad_s")
      ->type_name("FILE|-");
  command
      ->add_option("--trajectory", options->trajectory,
                   "follow the motion of a file in place of the scene's goals, as hamelin optimize "
                   "writes it, or ROS 2's JointTrajectory as JSON")
      ->type_name("FILE");
  command->add_flag("--print-config", options->print_config,
                    "print the resolved scene, with all defaults and with paths from the working "
                    "directory, and exit");
  add_record_options(*command, options->record);
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

const RegisteredCommand registered_run("run", add_run);

}  // namespace

}  // namespace hamelin::app

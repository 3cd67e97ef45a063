#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "free_motion.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/simulation/run.hpp"
#include "integrator_options.hpp"
#include "record.hpp"
#include "robot_notes.hpp"
#include "scene_flags.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

struct IntegrateOptions {
  MotionFlags motion;
  IntegratorFlags integrator;
  std::optional<double> step_s, duration_s;
  bool print_config = false;
  RecordOptions record;
};

int integrate(const IntegrateOptions& options) {
  scene::Scene scene = read_motion(options.motion);
  const model::Model model = control::load_model(scene);
  note_warnings(model.robot(), scene.robot.file);
  set_start(options.motion, model.dof(), scene);
  scene.step_s = options.step_s.value_or(scene.step_s);
  scene.duration_s = options.duration_s.value_or(scene.duration_s);
  const std::string name = options.integrator.integrator.value_or(scene.integrator.name);
  // The scene's parameters belong to the scene's integrator only.
  if (name != scene.integrator.name) scene.integrator = {name, Json::object()};
  scene.integrator.params = integrator_params(options.integrator, name, scene.integrator.params);
  const auto motion = simulation::free_motion(scene, model);
  if (options.print_config) {
    print_json(motion.config);
    return 0;
  }
  return record(options.record, files_of(scene), [&](const simulation::Watch& watch) {
    return simulation::integrate(model, motion, watch);
  });
}

void add_integrate(CLI::App& app, int& exit_code) {
  auto* command = add_command(
      app, "integrate",
      "Integrate the free motion of a robot, without planner and obstacles. A robot file falls "
      "under gravity, -9.81 m/s^2 along z. Of a scene file, robot, base, gravity, damping, "
      "friction "
      "and start are used; limits have no effect",
      "hamelin integrate data/robots/planar3.json --step 0.01 --duration 100\n"
      "hamelin integrate data/robots/planar3.json --integrator hamel --alpha 1 --step 0.01 --log "
      "f.jsonl");
  const auto options = std::make_shared<IntegrateOptions>();
  add_motion_flags(*command, options->motion);
  add_integrator_flags(*command, options->integrator);
  command
      ->add_option("--step", options->step_s,
                   "time step [s], under step control the first one (default the scene's, or 1e-3)")
      ->type_name("H");
  command
      ->add_option(
          "--duration", options->duration_s,
          "simulated time [s], an integer multiple of a fixed step (default the scene's, or 10)")
      ->type_name("T");
  command->add_flag("--print-config", options->print_config,
                    "print the resolved scene, with all defaults and with paths from the working "
                    "directory, and exit");
  add_record_options(*command, options->record);
  command->callback([options, &exit_code] { exit_code = integrate(*options); });
}

const RegisteredCommand registered_integrate("integrate", add_integrate);

}  // namespace

}  // namespace hamelin::app

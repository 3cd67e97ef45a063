#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "document.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/model/robot_io.hpp"
#include "hamelin/simulation/run.hpp"
#include "integrator_options.hpp"
#include "record.hpp"
#include "scene_flags.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

struct IntegrateOptions {
  std::filesystem::path file;
  std::optional<std::string> tip, q0, v0;
  IntegratorFlags integrator;
  std::optional<double> step_s, duration_s;
  bool print_config = false;
  RecordOptions record;
};

void say_what_is_ignored(const scene::Scene& scene) {
  std::vector<std::string> ignored;
  if (scene.planner) ignored.push_back(fmt::format("planner '{}'", scene.planner->name));
  if (scene.map) ignored.push_back("the map");
  if (!scene.obstacles.empty()) ignored.push_back(fmt::format("{} obstacle(s)", scene.obstacles.size()));
  if (!scene.goals.empty()) ignored.push_back(fmt::format("{} goal(s)", scene.goals.size()));
  if (!ignored.empty()) note(fmt::format("{}: free motion, ignored: {}", scene.name, fmt::join(ignored, ", ")));
}

// The scene, or for a bare robot one with all defaults.
scene::Scene read_motion(const IntegrateOptions& options) {
  const Kind kind = kind_of(options.file);
  scene::Scene scene;
  if (kind == Kind::scene) {
    scene = scene::read_scene(options.file);
    say_what_is_ignored(scene);
  } else if (kind == Kind::urdf || kind == Kind::robot) {
    scene.name = options.file.string();
    scene.robot.file = options.file;
    scene.gravity_m_s2 = Eigen::Vector3d{0.0, 0.0, -9.81};
  } else {
    throw Error(ErrorCode::invalid,
                fmt::format("{}: is a {}, expected a robot or a scene", options.file.string(), to_string(kind)));
  }
  if (options.tip) scene.robot.tip = options.tip;
  return scene;
}

void set_joints(const char* option, const std::optional<std::string>& given, int dof, Eigen::VectorXd& joints) {
  if (!given) return;
  const auto numbers = number_list(option, *given, static_cast<std::size_t>(dof));
  joints = Eigen::Map<const Eigen::VectorXd>(numbers.data(), dof);
}

int integrate(const IntegrateOptions& options) {
  scene::Scene scene = read_motion(options);
  const model::Model model = simulation::load_model(scene);
  set_joints("--q0", options.q0, model.dof(), scene.start_q);
  set_joints("--v0", options.v0, model.dof(), scene.start_v);
  scene.step_s = options.step_s.value_or(scene.step_s);
  scene.duration_s = options.duration_s.value_or(scene.duration_s);
  const std::string name = options.integrator.integrator.value_or(scene.integrator.name);
  // another integrator does not know the parameters of the scene's
  if (name != scene.integrator.name) scene.integrator = {name, Json::object()};
  scene.integrator.params = integrator_params(options.integrator, name, scene.integrator.params);
  const auto motion = simulation::free_motion(scene, model);
  if (options.print_config) {
    print_json(motion.config);
    return 0;
  }
  return record(options.record, files_of(scene),
                [&](const simulation::Watch& watch) { return simulation::integrate(model, motion, watch); });
}

}  // namespace

void add_integrate(CLI::App& app, int& exit_code) {
  auto* command = add_command(
      app, "integrate",
      "Let a robot move freely: no planner, no obstacles. A bare robot falls under -9.81 m/s^2 along z; of a scene, "
      "robot, base, gravity, damping and start are used",
      "hamelin integrate data/robots/planar3.json --step 0.01 --duration 100\n"
      "hamelin integrate data/robots/planar3.json --integrator hamel --alpha 1 --step 0.01 --log f.jsonl");
  const auto options = std::make_shared<IntegrateOptions>();
  command->add_option("file", options->file, "a scene, or a robot (.urdf or JSON)")
      ->required()
      ->type_name("SCENE_OR_ROBOT");
  command->add_option("--tip", options->tip, "link that is the tip (URDF: default the only leaf)")->type_name("LINK");
  add_integrator_flags(*command, options->integrator);
  command->add_option("--step", options->step_s, "time step [s] (default the scene's, else 1e-3)")->type_name("H");
  command->add_option("--duration", options->duration_s, "[s], a whole number of steps (default the scene's, else 10)")
      ->type_name("T");
  command->add_option("--q0", options->q0, "joints at the start [rad or m] (default the scene's, else 0)")
      ->type_name("a,b,..");
  command->add_option("--v0", options->v0, "joint velocities at the start (default the scene's, else 0)")
      ->type_name("a,b,..");
  command->add_flag(
      "--print-config", options->print_config,
      "print what would be integrated as a scene with every default, and leave; paths are as seen from here");
  add_record_options(*command, options->record);
  command->callback([options, &exit_code] { exit_code = integrate(*options); });
}

}  // namespace hamelin::app

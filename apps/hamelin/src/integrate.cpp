#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "document.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/log/provenance.hpp"
#include "hamelin/model/robot_io.hpp"
#include "hamelin/simulation/run.hpp"
#include "integrator_options.hpp"
#include "record.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

using Eigen::VectorXd;

struct IntegrateOptions {
  std::filesystem::path file;
  std::optional<std::string> tip, q0, v0;
  IntegratorFlags integrator;
  std::optional<double> step_s, duration_s;
  RecordOptions record;
};

// What is integrated, before flags have their say.
struct Motion {
  model::Model model;
  scene::Scene scene;  ///< of a bare robot: all defaults
  std::vector<std::filesystem::path> inputs;
};

void say_what_is_ignored(const scene::Scene& scene) {
  std::vector<std::string> ignored;
  if (scene.planner) ignored.push_back(fmt::format("planner '{}'", scene.planner->name));
  if (scene.map) ignored.push_back("the map");
  if (!scene.obstacles.empty()) ignored.push_back(fmt::format("{} obstacle(s)", scene.obstacles.size()));
  if (!scene.goals.empty()) ignored.push_back(fmt::format("{} goal(s)", scene.goals.size()));
  if (!ignored.empty()) note(fmt::format("{}: free motion, ignored: {}", scene.name, fmt::join(ignored, ", ")));
}

Motion read_motion(const IntegrateOptions& options) {
  const Kind kind = kind_of(options.file);
  if (kind == Kind::scene) {
    scene::Scene scene = scene::read_scene(options.file);
    if (options.tip) scene.robot.tip = options.tip;
    say_what_is_ignored(scene);
    std::vector<std::filesystem::path> inputs = {options.file, scene.robot.file};
    if (scene.robot.spheres) inputs.push_back(*scene.robot.spheres);
    return {simulation::load_model(scene), std::move(scene), std::move(inputs)};
  }
  if (kind != Kind::urdf && kind != Kind::robot)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: is a {}, expected a robot or a scene", options.file.string(), to_string(kind)));
  return {model::Model(model::read_robot(options.file, {options.tip, {}})), {}, {options.file}};
}

VectorXd joint_vector(const char* option, const std::optional<std::string>& given, const VectorXd& otherwise, int dof) {
  if (!given) return otherwise.size() > 0 ? otherwise : VectorXd::Zero(dof);
  const auto numbers = number_list(option, *given, static_cast<std::size_t>(dof));
  return Eigen::Map<const VectorXd>(numbers.data(), dof);
}

VectorXd damping_of(const scene::Scene& scene, const model::Robot& robot) {
  const auto& damping = scene.model.joint_damping;
  const int n = robot.dof();
  VectorXd values;
  if (damping.from_robot) {
    values.resize(n);
    for (int i = 0; i < n; ++i) values[i] = robot.links[static_cast<std::size_t>(i)].joint.damping;
  } else if (damping.values.size() == 1) {
    values = VectorXd::Constant(n, damping.values[0]);
  } else if (!damping.values.empty()) {
    if (damping.values.size() != static_cast<std::size_t>(n))
      throw Error(ErrorCode::invalid, fmt::format("{}: /model/joint_damping: {} numbers given, expected 1 or {}",
                                                  scene.name, damping.values.size(), n));
    values = Eigen::Map<const VectorXd>(damping.values.data(), n);
  }
  return values;
}

int integrate(const IntegrateOptions& options) {
  const Motion motion = read_motion(options);
  const auto& model = motion.model;
  simulation::FreeMotion free;
  free.name = options.file.string();
  free.q0 = joint_vector("--q0", options.q0, motion.scene.start_q, model.dof());
  free.v0 = joint_vector("--v0", options.v0, motion.scene.start_v, model.dof());
  free.step_s = options.step_s.value_or(motion.scene.step_s);
  free.duration_s = options.duration_s.value_or(motion.scene.duration_s);
  free.integrator = options.integrator.integrator.value_or(motion.scene.integrator.name);
  const bool scenes_own = free.integrator == motion.scene.integrator.name;
  const Json params = integrator_params(options.integrator, free.integrator,
                                        scenes_own ? motion.scene.integrator.params : Json(Json::object()));
  free.options = integration::options_from_json(params, "integrator " + free.integrator);
  free.damping = damping_of(motion.scene, model.robot());
  return record(options.record, options.file, [&](const simulation::Watch& watch) {
    free.provenance = log::provenance(motion.inputs, command_line());
    return simulation::integrate(model, free, watch);
  });
}

}  // namespace

void add_integrate(CLI::App& app, int& exit_code) {
  auto* command = add_command(
      app, "integrate",
      "Let a robot move freely: no planner, no obstacles. A bare robot falls under -9.81 m/s^2 along z; of a scene, "
      "robot, base, gravity, damping and start are used",
      "hamelin integrate data/robots/planar3.json --integrator hamel --alpha 0.5 --step 0.01 --duration 10");
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
  add_record_options(*command, options->record);
  command->callback([options, &exit_code] { exit_code = integrate(*options); });
}

}  // namespace hamelin::app

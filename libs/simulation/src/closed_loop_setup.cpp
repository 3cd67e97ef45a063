// A scene becomes a loop that is ready to run.
#include "closed_loop.hpp"

#include <fmt/format.h>
#include <spdlog/logger.h>

#include <utility>

#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/log/provenance.hpp"
#include "hamelin/scene/modelled.hpp"
#include "plants.hpp"
#include "scene_values.hpp"

namespace hamelin::simulation {

namespace {

using Eigen::VectorXd;

// Prefixes errors of another library with the scene's name.
template <class F>
auto in_scene(const scene::Scene& scene, const char* place, F&& f) {
  try {
    return f();
  } catch (const Error& e) {
    throw Error(e.code(), fmt::format("{}: {}: {}", scene.name, place, e.what()));
  }
}

std::vector<log::Input> all_inputs(const scene::Scene& scene, const planning::Plugin& plugin,
                                   const Json& params) {
  std::vector<log::Input> inputs = inputs_of(scene);
  if (scene.map) {
    if (!scene.map->file.empty()) inputs.push_back({"map", scene.map->file});
    for (std::size_t i = 0; i < scene.map->changes.size(); ++i)
      if (const auto& file = scene.map->changes[i].file)
        inputs.push_back({fmt::format("map_change_{}", i), *file});
  }
  for (std::size_t i = 0; i < scene.events.size(); ++i)
    if (const auto& map = scene.events[i].map; map && map->file)
      inputs.push_back({fmt::format("event_map_{}", i), *map->file});
  for (std::size_t i = 0; i < scene.obstacles.size(); ++i)
    if (const auto file = scene::waypoint_file(scene.obstacles[i]); !file.empty())
      inputs.push_back({fmt::format("waypoints_{}", i), file});
  for (std::size_t i = 0; i < scene.goals.size(); ++i)
    if (const auto file = scene::target_file(scene.goals[i]); !file.empty())
      inputs.push_back({fmt::format("target_{}", i), file});
  inputs.push_back({"plugin", plugin.file()});
  for (const auto& name : plugin.file_params())
    if (params[name].is_string())
      inputs.push_back(
          {fmt::format("{}{}", planner_file_role, name), params[name].get<std::string>()});
  return inputs;
}

model::Model load_checked(const scene::Scene& scene) {
  model::Model model = control::load_model(scene);
  control::check_numbers(scene, model);
  return model;
}

}  // namespace

ClosedLoop::ClosedLoop(const scene::Scene& scene,
                       const std::vector<std::filesystem::path>& plugin_directories,
                       const PlantFactory& plant_factory)
    : scene_(scene),
      model_(load_checked(scene)),
      limits_(control::modelled_limits(scene, model_.robot())),
      q_shown_(VectorXd::Zero(model_.dof())),
      v_shown_(q_shown_),
      bare_(model_) {
  make_plant(plant_factory);
  result_.warnings = model_.robot().warnings;
  const planning::Plugin plugin = control::find_planner(scene, plugin_directories);
  planner_params_ = control::planner_params(scene, plugin);
  steps_ =
      in_scene(scene, "/duration_s", [&] { return step_count(scene.duration_s, scene.step_s); });
  controller_ = std::make_unique<control::Controller>(scene, model_, plugin, planner_params_,
                                                      controller_options());
  judge_ = std::make_unique<Judge>(scene, model_, *plant_, &controller_->view());
  if (const control::WorldView& view = judge_->view();
      view.has_self() && !view.self_field()->note().empty())
    result_.warnings.push_back(view.self_field()->note());
  if (!scene.wrenches.empty())
    wrenches_ = std::make_unique<WrenchFeed>(scene.wrenches, model_, scene.name + ": /wrenches");
  if (!scene.sensors.empty()) sensors_ = std::make_unique<SensorFeed>(scene, model_);
  inputs_ = all_inputs(scene, plugin, planner_params_);
}

control::Controller::Options ClosedLoop::controller_options() {
  control::Controller::Options options;
  // no more than the scene's, and bodies that sensors follow
  constexpr std::size_t bodies_max = 16;
  options.obstacles_max = scene_.sensors.empty() ? 0 : scene_.obstacles.size() + bodies_max;
  options.prepare_maps = false;
  options.fixed_world = scene_.sensors.empty();
  options.path_points_max = 0;   // no more than the scene's
  options.guide_thread = false;  // results do not depend on the speed of the machine
  options.certify = false;       // the judge does, for every step and with all obstacles
  options.ideal_arm = ideal_arm_;
  options.position = scene_.actuation.type == scene::ActuationType::position;
  const auto bounds = [&](const std::vector<double>& values, const char* key) {
    const VectorXd all = servo_values(scene_, values, key, model_.dof());
    return std::vector<double>(all.begin(), all.end());
  };
  options.acceleration_max = bounds(scene_.actuation.servo.acceleration_max, "acceleration_max");
  options.jerk_max = bounds(scene_.actuation.servo.jerk_max, "jerk_max");
  options.period_s = static_cast<double>(steps_per_tick(scene_)) * scene_.step_s;
  options.clock_s = control::steady_clock_s;
  options.late_answers_max = 0;  // no decision depends on the clock
  options.log_overrun = false;   // nor does a log; the result has the number
  options.log = [this](std::int32_t level, std::string_view line) {
    log_planner_message(level, line);
  };
  return options;
}

void ClosedLoop::make_plant(const PlantFactory& factory) {
  if (scene_.actuation.type == scene::ActuationType::ideal &&
      scene_.plant == scene::PlantType::hamelin) {
    auto arm = make_simulated_arm(scene_, model_);
    ideal_arm_ = &arm->arm();
    actuation_ = make_ideal_actuation(scene_, *arm);
    plant_ = std::move(arm);
  } else {
    plant_ = simulation::make_plant(scene_, model_, factory);
    actuation_ = make_sampled_actuation(scene_, model_, *plant_);
  }
}

void ClosedLoop::check_start() const {
  if (const std::string defect = scene::start_defect(scene_, model_); !defect.empty())
    throw Error(ErrorCode::invalid, fmt::format("{}: {}", scene_.name, defect));
}

void ClosedLoop::start(const Watch& watch) {
  watch_ = &watch;
  const Plant::Description& plant = plant_->description();
  recorder_ = std::make_unique<Recorder>(result_, watch, plant.integrator, plant.criterion,
                                         plant.tolerance);
  const bool ideal = scene_.actuation.type == scene::ActuationType::ideal;
  audit_ =
      std::make_unique<EnergyAudit>(*recorder_, ideal && plant.integrator == "hamel-variational");
  log_ = std::make_unique<TickLog>(*recorder_, model_, *plant_, judge_->view(), *controller_,
                                   *actuation_);
  if (control::follow_goal_of(scene_.goals) != nullptr) {
    tracking_ = std::make_unique<TrackingAudit>(model_, limits_);
    log_->add_target(*tracking_);
  }
  open_target_feed(watch);
  result_.provenance = log::provenance(inputs_, watch.argv);
  if (recorder_->logging()) log_->header(scene_, planner_params_, result_.provenance, steps_);
  if (watch.diagnostics)
    for (const auto& line : scene::describe_modelled(scene::modelled_info(scene_, model_)))
      watch.diagnostics->info("{}: {}", scene_.name, line);
  for (const auto& line : early_messages_) report_event(line.warning, line.text);
  for (const std::string& line : judge_->describe_goals_in_contact()) {
    result_.warnings.push_back(line);
    if (watch.diagnostics) watch.diagnostics->info(line);
  }
}

void ClosedLoop::open_target_feed(const Watch& watch) {
  const scene::Goal* const goal = control::follow_goal_of(scene_.goals);
  if (goal == nullptr || goal->motion) {
    if (watch.target == nullptr) return;
    throw Error(ErrorCode::usage,
                fmt::format("{}: /goals: no goal follows a streamed target, expected one where a "
                            "stream is given",
                            scene_.name));
  }
  if (watch.target != nullptr) {
    feed_ = std::make_unique<TargetFeed>(*watch.target, "target", goal->position_only);
  } else if (!goal->stream.file.empty()) {
    feed_ = std::make_unique<TargetFeed>(goal->stream.file, goal->position_only);
  } else {
    throw Error(ErrorCode::usage,
                fmt::format("{}: /goals/{}/stream/file: is missing, expected a file, or --target "
                            "FILE, where a target is streamed",
                            scene_.name, scene_.goals.size() - 1));
  }
}

}  // namespace hamelin::simulation

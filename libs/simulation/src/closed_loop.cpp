#include "closed_loop.hpp"

#include <fmt/format.h>
#include <spdlog/logger.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <utility>

#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/log/provenance.hpp"
#include "hamelin/scene/modelled.hpp"
#include "hamelin/simulation/integrator_options.hpp"
#include "scene_values.hpp"
#include "simulated_arm.hpp"

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
    inputs.push_back({"map", scene.map->file});
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

// Whether nothing is hidden from the controller, nothing changes, and it is shown the arm as it is:
// then one view of the world serves controller and judge.
bool controller_sees_all(const scene::Scene& scene) {
  const bool exact =
      scene.actuation.joint_noise_rad == 0.0 && scene.actuation.planner_mass_scale == 1.0 &&
      !scene.actuation.estimates_velocity && scene.actuation.type != scene::ActuationType::position;
  return exact && scene.events.empty() && !(scene.map && !scene.map->changes.empty()) &&
         std::all_of(scene.obstacles.begin(), scene.obstacles.end(),
                     [](const auto& o) { return o.known && !o.judge_only; });
}

model::Model load_checked(const scene::Scene& scene) {
  model::Model model = control::load_model(scene);
  control::check_numbers(scene, model);
  return model;
}

log::Result::Shield shield_figures(const control::Shield& shield, double work_J) {
  const control::Shield::Counts counts = shield.counts();
  log::Result::Shield out;
  out.margin_m = shield.largest_margin_m();
  out.steps = counts.steps;
  out.refused = counts.refused;
  out.refused_at_rest = counts.at_rest;
  out.stops = counts.stops;
  out.longest_stop_steps = counts.longest;
  for (std::size_t i = 0; i < counts.causes.size(); ++i)
    if (counts.causes[i] > 0)
      out.causes.emplace_back(to_string(static_cast<control::StopCause>(i)), counts.causes[i]);
  out.strayed_rad = counts.strayed;
  out.strayed_share = counts.strayed_share;
  out.overtaken = counts.overtaken;
  out.work_J = work_J;
  out.evasions = counts.evasions;
  for (std::size_t i = 0; i < counts.proofs.size(); ++i) {
    if (counts.proofs[i] == 0) continue;
    out.movers = to_string(static_cast<control::MoverProof>(i));
    out.mover_steps.emplace_back(*out.movers, counts.proofs[i]);
  }
  return out;
}

std::string shield_warning(const control::Shield& shield, const model::Model& model) {
  const control::Shield::Counts counts = shield.counts();
  const auto joint = static_cast<std::size_t>(counts.strayed_joint);
  return fmt::format(
      "the bounds of /safety do not hold: joint '{}' strayed from the motion of a "
      "stop by {:.2g} times the bound that follows from them",
      model.robot().links[joint].joint.name, counts.strayed_share);
}

// Stops that follow each other sooner are one event in the log [s].
constexpr double stop_again_s = 0.25;
// An arm that is slower has come to rest [rad/s or m/s].
constexpr double resting_speed = 2e-3;
// A run whose target is lost ends at the latest after this time, if the arm does not rest before.
constexpr double longest_halt_s = 2.0;

/// CPU time of a tick: without the log, a judge of its own, a caller that watches, and a plant that
/// is not hamelin's own.
class TickTimer {
 public:
  void pause() { spent_ += thread_cpu_s() - since_; }
  void resume() { since_ = thread_cpu_s(); }
  [[nodiscard]] double spent_s() const { return spent_ + thread_cpu_s() - since_; }

 private:
  double since_ = thread_cpu_s(), spent_ = 0.0;
};

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
  result_.warnings = model::warnings(model_.robot());
  const planning::Plugin plugin = control::find_planner(scene, plugin_directories);
  planner_params_ = control::planner_params(scene, plugin);
  steps_ =
      in_scene(scene, "/duration_s", [&] { return step_count(scene.duration_s, scene.step_s); });
  control::Controller::Options options;
  options.obstacles_max = 0;  // no more than the scene's
  options.prepare_maps = false;
  options.fixed_world = true;
  options.path_points_max = 0;   // no more than the scene's
  options.guide_thread = false;  // results do not depend on the speed of the machine
  options.certify = false;       // the judge does, for every step and with all obstacles
  options.ideal_arm = ideal_arm_;
  options.position = scene.actuation.type == scene::ActuationType::position;
  const auto bounds = [&](const std::vector<double>& values, const char* key) {
    const VectorXd all = servo_values(scene, values, key, model_.dof());
    return std::vector<double>(all.begin(), all.end());
  };
  options.acceleration_max = bounds(scene.actuation.servo.acceleration_max, "acceleration_max");
  options.jerk_max = bounds(scene.actuation.servo.jerk_max, "jerk_max");
  options.period_s = static_cast<double>(steps_per_tick(scene)) * scene.step_s;
  options.clock_s = control::steady_clock_s;
  options.late_answers_max = 0;  // no decision depends on the clock
  options.log_overrun = false;   // nor does a log; the result has the number
  options.log = [this](std::int32_t level, std::string_view line) {
    log_planner_message(level, line);
  };
  controller_ = std::make_unique<control::Controller>(scene, model_, plugin, planner_params_,
                                                      std::move(options));
  if (!controller_sees_all(scene))
    own_judge_ = std::make_unique<control::WorldView>(scene, model_, controller_->view());
  certifies_ = scene::safety_type(scene) != scene::SafetyType::none;
  judge_ = own_judge_ ? own_judge_.get() : &controller_->view();
  if (judge_->has_self() && !judge_->self_field()->note().empty())
    result_.warnings.push_back(judge_->self_field()->note());
  inputs_ = all_inputs(scene, plugin, planner_params_);
}

void ClosedLoop::make_plant(const PlantFactory& factory) {
  const VectorXd zero = VectorXd::Zero(model_.dof());
  const VectorXd &q = scene_.start_q.size() > 0 ? scene_.start_q : zero,
                 &v = scene_.start_v.size() > 0 ? scene_.start_v : zero;
  if (scene_.plant != scene::PlantType::hamelin) {
    if (!factory)
      throw Error(ErrorCode::usage,
                  fmt::format("{}: /plant/type: is {}, which this build of hamelin is without, "
                              "expected hamelin; to build with MuJoCo, install libmujoco-dev and "
                              "configure again",
                              scene_.name, to_string(scene_.plant)));
    const VectorXd damping = plant_damping(scene_, model_.robot()),
                   friction = plant_friction(scene_, model_.robot());
    plant_ = factory({scene_, model_, damping.size() > 0 ? damping : zero,
                      friction.size() > 0 ? friction : zero});
    plant_->start(q, v);
    actuation_ = make_sampled_actuation(scene_, model_, *plant_);
    return;
  }
  auto arm = std::make_unique<SimulatedArm>(
      scene_, model_,
      integrator_options(scene_.integrator.params, scene_.name + ": /integrator/params"));
  arm->start(q, v);
  if (scene_.actuation.type == scene::ActuationType::ideal) {
    ideal_arm_ = &arm->arm();
    actuation_ = make_ideal_actuation(scene_, *arm);
  } else {
    actuation_ = make_sampled_actuation(scene_, model_, *arm);
  }
  plant_ = std::move(arm);
}

void ClosedLoop::check_start() const {
  if (const std::string defect = scene::start_defect(scene_, model_); !defect.empty())
    throw Error(ErrorCode::invalid, fmt::format("{}: {}", scene_.name, defect));
}

void ClosedLoop::log_planner_message(std::int32_t level, std::string_view line) {
  const bool warning = level == HAMELIN_LOG_WARNING;
  // Such a message would be written nowhere.
  if (!warning && recorder_ && !recorder_->logging() && !has_diagnostics(spdlog::level::debug))
    return;
  std::string text = fmt::format("{}: {}", scene_.planner->name, line);
  if (warning) result_.warnings.push_back(text);
  if (!recorder_) return early_messages_.push_back({warning, std::move(text)});
  report_event(warning, text);
}

void ClosedLoop::report_event(bool warning, const std::string& text) {
  recorder_->event(plant_->node().time_s, text);
  if (watch_->diagnostics)
    watch_->diagnostics->log(warning ? spdlog::level::warn : spdlog::level::debug, text);
}

bool ClosedLoop::has_diagnostics(int level) const {
  return watch_ != nullptr && watch_->diagnostics &&
         watch_->diagnostics->should_log(static_cast<spdlog::level::level_enum>(level));
}

void ClosedLoop::start(const Watch& watch) {
  watch_ = &watch;
  const Plant::Description& plant = plant_->description();
  recorder_ = std::make_unique<Recorder>(result_, watch, plant.integrator, plant.criterion,
                                         plant.tolerance);
  const bool ideal = scene_.actuation.type == scene::ActuationType::ideal;
  audit_ =
      std::make_unique<EnergyAudit>(*recorder_, ideal && plant.integrator == "hamel-variational");
  log_ = std::make_unique<TickLog>(*recorder_, model_, *plant_, *judge_, *controller_, *actuation_);
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
  min_clearance_ = judge_->influence_m();
  min_self_clearance_ = judge_->self_influence_m();
  warn_of_goals_in_contact(watch);
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

log::Result ClosedLoop::run(const Watch& watch) {
  start(watch);
  while (!done_) {
    TickTimer timer;
    if (own_judge_) timer.pause();
    observe_node();
    if (own_judge_) timer.resume();
    if (watch.at_node) {
      timer.pause();
      watch.at_node(plant_->node().time_s, plant_->node().q);
      timer.resume();
    }
    check_outcome();
    if (done_)
      book_last_node();
    else if (actuation_->is_tick(plant_->node().k))
      ask_planner();
    if (!done_) apply_answer();
    if (controller_->guide_figures() != nullptr) {
      timer.pause();
      controller_->run_guide();
      timer.resume();
    }
    if (recorder_->logging()) timer.pause();
    write_tick();
    if (recorder_->logging()) timer.resume();
    if (done_) break;
    if (scene_.plant != scene::PlantType::hamelin) timer.pause();
    step();
    if (scene_.plant != scene::PlantType::hamelin) timer.resume();
    if (!done_) recorder_->tick_time(timer.spent_s());
  }
  fill_result();
  recorder_->close(audit_->ledger());
  return result_;
}

void ClosedLoop::observe_node() {
  judge_->look(plant_->node().q, plant_->node().time_s);
  note_limits();
  reveal_obstacles();
  min_clearance_ = std::min(min_clearance_, judge_->clearance_m());
  min_self_clearance_ = std::min(min_self_clearance_, judge_->self_clearance_m());
  touching_ = judge_->touching();
  contacts_ = plant_->contacts();
  if (plant_->node().k > 0 && certifies_ && (judge_->has_obstacles() || judge_->has_self()))
    certify();
  change_map();
  recorder_->observe(judge_->clearance_m(), certified_, plant_->node().v, scene_.step_s);
}

void ClosedLoop::note_limits() {
  const Plant::Node& node = plant_->node();
  const auto raise = [](std::optional<double>& most, double excess) {
    most = std::max(most.value_or(0.0), excess);
  };
  if (limits_.q_lower.size() > 0)
    raise(result_.position_excess,
          std::max((node.q - limits_.q_upper).maxCoeff(), (limits_.q_lower - node.q).maxCoeff()));
  if (limits_.velocity_max.size() > 0)
    raise(result_.speed_excess, (node.v.cwiseAbs() - limits_.velocity_max).maxCoeff());
}

void ClosedLoop::certify() {
  const auto verdict = judge_->certify(plant_->node().q, plant_->node().v);
  certified_ = verdict.certified;
  ++checked_steps_;
  if (certified_) ++certified_steps_;
  result_.tightest_step_m =
      std::min(result_.tightest_step_m.value_or(verdict.margin_m), verdict.margin_m);
  if (!verdict.contact || touching_) return;
  const std::string parts =
      verdict.self_pair < 0
          ? ""
          : fmt::format("of {} ", judge_->self_field()->describe(verdict.self_pair));
  finish(log::Outcome::collision, fmt::format("contact {}between the nodes {} and {}", parts,
                                              plant_->node().k - 1, plant_->node().k));
}

void ClosedLoop::reveal_obstacles() {
  for (const int found : judge_->revealed()) {
    scene::Obstacle obstacle = judge_->environment().obstacles()[static_cast<std::size_t>(found)];
    recorder_->event(plant_->node().time_s,
                     fmt::format("obstacle '{}' becomes visible", obstacle.name));
    obstacle.known = true;
    controller_->world().set_obstacle(std::move(obstacle));
  }
}

// The step that led here was checked against the old map; what follows is checked against the new
// one.
void ClosedLoop::change_map() {
  const std::string change = own_judge_ ? own_judge_->advance_map() : "";
  if (change.empty()) return;
  report_event(false, change);
  for (const auto& changes = scene_.map->changes;
       next_map_change_ < changes.size() &&
       changes[next_map_change_].time_s <= plant_->node().time_s + 1e-9;
       ++next_map_change_)
    controller_->world().change_map(changes[next_map_change_]);
  judge_->look(plant_->node().q, plant_->node().time_s);
  min_clearance_ = std::min(min_clearance_, judge_->clearance_m());
  touching_ = touching_ || judge_->clearance_m() <= 0.0;
}

void ClosedLoop::check_outcome() {
  const Plant::Node& node = plant_->node();
  if (!node.v.allFinite() || !node.q.allFinite())
    return finish(log::Outcome::diverged,
                  fmt::format("step {}: the state is no longer finite", node.k));
  count_contacts();
  const bool contact = touching_ || contacts_.count > 0;
  if (contact && node.k > 0) {
    result_.mover_contact = mover_contact();
    return finish(log::Outcome::collision, describe_contact());
  }
  if (contact) return refuse();
  if (done_) return;
  const bool tick = actuation_->is_tick(node.k);
  if (tick) let_controller_observe();
  if (tick && next_event_ < scene_.events.size()) advance_events();
  if (done_) return;
  note_tracking();
  if (tick) note_reference();
  if (tick) check_target();
  if (done_) return;
  const control::ControlState now = controller_->answer().state;
  if (now == control::ControlState::reached && arrived())
    finish(log::Outcome::reached, "");
  else if (tick && now == control::ControlState::stalled)
    finish(log::Outcome::stalled,
           fmt::format("at rest for {} s away from the goal", scene_.stall->hold_s));
  else if (halting_ && (rests() || node.k == steps_))
    finish(result_.outcome, result_.cause);
  else if (node.k == steps_ && controller_->goals().follows())
    finish(log::Outcome::followed, "");
  else if (node.k == steps_)
    finish(log::Outcome::timeout, timeout_cause());
  else if (recorder_->stopped(node.k))
    finish(log::Outcome::interrupted, "stopped from outside");
}

std::string ClosedLoop::timeout_cause() const {
  const std::string cause = fmt::format("goal not reached within {} s", scene_.duration_s);
  const control::Shield* const shield = controller_->shield();
  if (shield == nullptr || !shield->stopping() || !shield->stop().at_rest()) return cause;
  return fmt::format("{}; the shield has held the arm since {:.3f} s: {}", cause, stopped_at_s_,
                     shield->describe(controller_->view().environment()));
}

bool ClosedLoop::rests() const {
  return controller_->shield()->stop().at_rest() &&
         plant_->node().v.lpNorm<Eigen::Infinity>() < resting_speed;
}

bool ClosedLoop::arrived() const {
  return scene_.actuation.type != scene::ActuationType::position || goal_error().reached;
}

control::GoalError ClosedLoop::goal_error() const {
  dynamics::Workspace ws(model_);
  dynamics::forward_kinematics(model_, ws, plant_->node().q);
  if (const control::TargetState* const target = controller_->answer().target)
    return control::target_error(controller_->goals().goal(), target->pose, model_, ws);
  return control::goal_error(controller_->goals().goal(), model_, ws, plant_->node().q,
                             plant_->node().v);
}

void ClosedLoop::count_contacts() {
  const Plant::Description& plant = plant_->description();
  if (!plant.detects_contacts) return;
  if (!result_.plant) result_.plant = {plant.type, plant.version, 0, 0, {}};
  // A contact that the judge found between two nodes has ended the run already.
  if (touching_ || done_) ++result_.plant->judge_contacts;
  if (contacts_.count == 0) return;
  ++result_.plant->contacts;
  result_.plant->deepest_m =
      std::min(result_.plant->deepest_m.value_or(contacts_.deepest_m), contacts_.deepest_m);
}

std::optional<log::Result::MoverContact> ClosedLoop::mover_contact() const {
  const scene::Contact* const touch = judge_->nearest();
  // Between two nodes, contact is found where both of them are still apart.
  constexpr double at_node_m = 1e-3;
  if (touch == nullptr || touch->distance > at_node_m || touch->obstacle < 0) return std::nullopt;
  const auto index = static_cast<std::size_t>(touch->obstacle);
  const scene::Environment& environment = judge_->environment();
  const scene::Obstacle& obstacle = environment.obstacles()[index];
  if (!environment.moves(index) && obstacle.appears_s <= 0.0) return std::nullopt;
  const int link = model_.shapes()[static_cast<std::size_t>(touch->sphere)].link;
  const dynamics::Workspace& poses = judge_->poses();
  const double now = plant_->node().time_s;
  const Eigen::Vector3d arm =
      dynamics::point_velocity(model_, poses, link, touch->arm_point, plant_->node().v);
  log::Result::MoverContact out;
  out.obstacle = obstacle.name;
  out.link = model_.robot().links[static_cast<std::size_t>(link)].name;
  out.prediction = scene::to_string(obstacle.prediction);
  out.time_s = now;
  out.arm_speed_m_s = arm.norm();
  out.obstacle_speed_m_s = touch->obstacle_velocity.norm();
  out.closing_speed_m_s = touch->direction.dot(touch->obstacle_velocity - arm);
  const Eigen::Vector3d at = scene::motion_at(obstacle, now).pose.p();
  for (const double ahead : {0.1, 0.3, 1.0}) {
    if (ahead > now || !scene::exists(obstacle, now - ahead)) continue;
    const scene::Placed predicted = scene::placed_at(obstacle, {now - ahead, ahead});
    out.prediction_errors.push_back(
        {ahead, std::max(0.0, (predicted.pose.p() - at).norm() - predicted.nearer_m)});
  }
  return out;
}

std::string ClosedLoop::describe_contact() const {
  const Plant::Description& plant = plant_->description();
  if (!plant.detects_contacts) return judge_->describe_contact();
  std::string judged =
      fmt::format("counts none at a clearance of {:.2g} mm",
                  1e3 * std::min(judge_->clearance_m(),
                                 judge_->has_self() ? judge_->self_clearance_m() : infinity));
  if (touching_)
    judged = judge_->describe_contact();
  else if (done_)
    judged = result_.cause;
  return fmt::format("{} {}; the judge: {}", plant.name,
                     contacts_.count > 0 ? plant_->describe_contact() : "counts no contact",
                     judged);
}

void ClosedLoop::refuse() {
  std::string cause = describe_contact();
  if (touching_ && judge_->clearance_m() > 0.0)
    cause += fmt::format("; {}", scene::self_contact_remedy(scene_.robot));
  finish(log::Outcome::refused, std::move(cause));
}

void ClosedLoop::let_controller_observe() {
  observed_k_ = plant_->node().k;
  if (feed_) feed_target();
  actuation_->observe(q_shown_, v_shown_);
  controller_->observe(plant_->node().time_s, q_shown_, v_shown_);
  const control::GoalTracker& goals = controller_->goals();
  while (goals_reached_ < goals.index())
    recorder_->event(plant_->node().time_s,
                     fmt::format("goal {} of {} reached", ++goals_reached_, goals.size()));
}

void ClosedLoop::feed_target() {
  feed_->advance(plant_->node().time_s, *controller_, [this](const std::string& line) {
    // Only the first few become warnings of the result: a stream may be wrong line by line.
    constexpr long warned = 5;
    if (tracking_->count_refused_line() <= warned) result_.warnings.push_back(line);
    report_event(true, line);
  });
}

void ClosedLoop::note_reference() {
  const control::ReferenceState* const reference = controller_->answer().reference;
  if (reference != nullptr)
    trajectory_.observe(controller_->goals().goal(), *reference, plant_->node().q,
                        controller_->period_s());
}

void ClosedLoop::note_tracking() {
  if (!tracking_ || controller_->answer().target == nullptr) return;
  tracking_->observe(controller_->goals().goal(), *controller_->answer().target, plant_->node().q,
                     *judge_, plant_->node().k > 0 ? scene_.step_s : 0.0);
}

void ClosedLoop::check_target() {
  const control::TargetState* const target = controller_->answer().target;
  if (target == nullptr || !feed_ || done_ || halting_) return;
  if (ends_by_s_) {  // the planner brings the arm to rest at a target that rests
    if (plant_->node().v.lpNorm<Eigen::Infinity>() < resting_speed ||
        plant_->node().time_s > *ends_by_s_)
      finish(log::Outcome::target_lost, std::string(result_.cause));
    return;
  }
  const scene::TargetStream& stream = controller_->goals().goal().stream;
  if (feed_->ended() && !feed_->last_s())
    return finish(log::Outcome::target_lost,
                  "no line of the stream of targets is valid, expected poses or twists");
  if (feed_->ended() && plant_->node().time_s > feed_->last_s().value_or(0.0) + stream.gap_max_s)
    return finish(log::Outcome::followed, "the stream of targets has ended");
  const bool lost_before = std::exchange(target_lost_, target->lost);
  if (!target->lost || lost_before) return;
  const std::string what = fmt::format(
      "the target is lost: no line of its stream for {} s, "
      "expected at most {} s between two lines",
      stream.gap_max_s, stream.gap_max_s);
  report_event(true, what);
  if (stream.when_lost != scene::WhenLost::end) return;
  result_.cause = what;
  ends_by_s_ = plant_->node().time_s + longest_halt_s;
}

void ClosedLoop::ask_planner() {
  try {
    controller_->decide();
  } catch (const Error& e) {
    if (e.code() != ErrorCode::invalid || plant_->node().k > 0) throw;
    return finish(log::Outcome::refused, e.what());
  }
  recorder_->planner_time(controller_->answer().planner_s);
  if (planner_answered() && controller_->answer().state == control::ControlState::gave_up)
    finish(log::Outcome::stalled, std::string(controller_->answer().cause));
  if (done_) book_answer();
}

bool ClosedLoop::planner_answered() {
  const control::Answer& answer = controller_->answer();
  if (answer.channels != nullptr) return true;
  if (answer.reason == control::StopReason::tracking) {
    finish_at_rest(log::Outcome::stalled, std::string(answer.cause));
    return false;
  }
  finish_at_rest(log::Outcome::defect,
                 fmt::format("planner '{}' at step {}: {}", scene_.planner->name, plant_->node().k,
                             answer.cause));
  return false;
}

void ClosedLoop::finish_at_rest(log::Outcome outcome, std::string cause) {
  if (controller_->shield() == nullptr) return finish(outcome, std::move(cause));
  if (!halting_) {
    result_.outcome = outcome;
    result_.cause = std::move(cause);
  }
  halting_ = true;
}

void ClosedLoop::report_stop() {
  const control::Shield* const shield = controller_->shield();
  if (shield == nullptr || !controller_->answer().stopping || !shield->stop_began()) return;
  const double last_s = std::exchange(stopped_at_s_, plant_->node().time_s);
  if (stopped_at_s_ - last_s < stop_again_s) return;
  report_event(false, fmt::format("the shield stops the arm: {}",
                                  shield->describe(controller_->view().environment())));
}

void ClosedLoop::apply_answer() {
  actuation_->apply(controller_->answer(), *audit_);
  report_stop();
  finish_if(audit_->fault(*plant_));
  const planning::CommandBuffers* const channels = controller_->answer().channels;
  if (channels == nullptr || controller_->answer().stopping) return;
  const std::string fault = audit_->fault_of_planner(channels->raw());
  if (!fault.empty())
    finish_if(
        fmt::format("planner '{}' at step {}: {}", scene_.planner->name, plant_->node().k, fault));
}

// Only the planner knows a control potential's value and its gradient for the closing half-kick.
void ClosedLoop::book_last_node() {
  if (plant_->node().k == 0 || result_.outcome == log::Outcome::diverged) return;
  if (actuation_->needs_answer_at_end()) {
    if (observed_k_ != plant_->node().k) let_controller_observe();
    controller_->decide();
    book_answer();
  } else {
    audit_->book_node(*plant_);
  }
  if (result_.outcome != log::Outcome::collision) finish_if(audit_->fault(*plant_));
}

void ClosedLoop::book_answer() {
  if (controller_->answer().channels != nullptr)
    actuation_->apply(controller_->answer(), *audit_);
  else
    audit_->book_node(*plant_);
}

void ClosedLoop::write_tick() {
  if (recorder_->wants_tick(plant_->node().k) || (done_ && recorder_->logging()))
    log_->tick(certified_, done_ ? nullptr : controller_->answer().channels);
}

void ClosedLoop::step() {
  judge_->depart(plant_->node().q, actuation_->departure_velocity());
  if (actuation_->saturated()) ++saturated_steps_;
  const bool converged = actuation_->step(scene_.step_s);
  recorder_->step(plant_->report());
  if (!converged) {
    finish(log::Outcome::diverged, fmt::format("step {} of {} s {}", plant_->node().k + 1,
                                               scene_.step_s, plant_->description().failure));
    if (recorder_->logging()) log_->tick(certified_, nullptr);
    return;
  }
  audit_->book_step(plant_->report(), controller_->answer().stopping);
  recorder_->progress(plant_->node().k, plant_->node().time_s, scene_.duration_s);
}

void ClosedLoop::finish(log::Outcome outcome, std::string cause) {
  result_.outcome = outcome;
  result_.cause = std::move(cause);
  done_ = true;
}

void ClosedLoop::finish_if(std::string defect) {
  if (!defect.empty()) finish(log::Outcome::defect, std::move(defect));
}

void ClosedLoop::warn_of_goals_in_contact(const Watch& watch) {
  const std::array<double, 1> point{0.0};
  const auto& environment = judge_->environment();
  for (std::size_t i = 0; i < scene_.goals.size(); ++i) {
    const auto& goal = scene_.goals[i];
    const bool of_joints = goal.type == scene::GoalType::joint;
    const auto warn = [&](const std::string& what) {
      result_.warnings.push_back(fmt::format("goal {}: {}", i + 1, what));
      if (watch.diagnostics) watch.diagnostics->info(result_.warnings.back());
    };
    if (!judge_->has_obstacles() && !judge_->has_self()) return;
    if (goal.type == scene::GoalType::follow) return;  // it moves
    const scene::Shapes placed =
        of_joints ? judge_->place(goal.q) : scene::Shapes{{&goal.pose.p(), 1}, point};
    scene::Contact deepest;
    if (judge_->deepest_at_start(placed, deepest))
      warn(fmt::format("{}; the exit direction is {}",
                       of_joints
                           ? environment.describe(deepest, model_)
                           : fmt::format("its tip is {:.2g} mm inside {}", -1e3 * deepest.distance,
                                         environment.describe(deepest.obstacle)),
                       scene::describe_exit_direction(deepest)));
    scene::SelfContact worst;
    if (of_joints && judge_->deepest_self(placed, worst))
      warn(fmt::format("the arm touches itself: {} are {:.2g} mm inside each other",
                       judge_->self_field()->describe(worst.pair), -1e3 * worst.distance));
  }
}

void ClosedLoop::fill_result() {
  if (judge_->has_obstacles()) result_.min_clearance_m = min_clearance_;
  if (judge_->has_self()) result_.min_self_clearance_m = min_self_clearance_;
  if (const auto* change = actuation_->torque_change()) result_.torque_change = *change;
  if (const control::Shield* const shield = controller_->shield())
    result_.shield = shield_figures(*shield, audit_->ledger().stop);
  if (result_.shield && result_.shield->strayed_share > 1.0)
    result_.warnings.push_back(shield_warning(*controller_->shield(), model_));
  if (const control::Guidance::Figures* const guide = controller_->guide_figures())
    result_.guide = {std::string(to_string(scene_.guide.type)),
                     guide->searches,
                     guide->found,
                     guide->kept,
                     guide->checks,
                     guide->waited_s,
                     guide->found > 0 ? std::optional(guide->length) : std::nullopt};
  result_.scene = scene_.name;
  result_.planner = controller_->plugin().name();
  result_.time_s = plant_->node().time_s;
  result_.steps = plant_->node().k;
  result_.q = plant_->node().q;
  result_.v = plant_->node().v;
  result_.seed = scene_.seed;
  result_.deadline_us = 1e6 * controller_->deadline_s();
  result_.late_ticks = controller_->answer().overruns;
  if (tracking_) result_.following = tracking_->figures();
  result_.trajectory = trajectory_.figures();
  const control::GoalTracker& goals = controller_->goals();
  const control::GoalError error = goal_error();
  log::Result::Goal out;
  out.type = scene::type_name(goals.goal());
  out.index = goals.index();
  out.count = goals.size();
  out.error_m = error.metres;
  out.error_rad = error.radians;
  result_.goal = out;
  if (checked_steps_ > 0)
    result_.certified_share =
        static_cast<double>(certified_steps_) / static_cast<double>(checked_steps_);
  for (const auto& warning : judge_->environment().summary().warnings)
    result_.warnings.push_back(warning);
  if (actuation_->limited() && plant_->node().k > 0) {
    result_.saturated_share =
        static_cast<double>(saturated_steps_) / static_cast<double>(plant_->node().k);
    if (saturated_steps_ > 0)
      result_.warnings.push_back(
          fmt::format("torque limits cut the planner's answer in {} of {} steps", saturated_steps_,
                      plant_->node().k));
  }
}

}  // namespace hamelin::simulation

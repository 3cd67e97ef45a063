#include "closed_loop.hpp"

#include <fmt/format.h>
#include <spdlog/logger.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <utility>

#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/log/provenance.hpp"
#include "hamelin/simulation/integrator_options.hpp"
#include "plant.hpp"

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

std::vector<log::Input> all_inputs(const scene::Scene& scene, const planning::Plugin& plugin) {
  std::vector<log::Input> inputs = inputs_of(scene);
  if (scene.map) {
    inputs.push_back({"map", scene.map->file});
    for (std::size_t i = 0; i < scene.map->changes.size(); ++i)
      if (const auto& file = scene.map->changes[i].file)
        inputs.push_back({fmt::format("map_change_{}", i), *file});
  }
  inputs.push_back({"plugin", plugin.file()});
  return inputs;
}

// Whether nothing is hidden from the controller, nothing changes, and it measures exactly: then one
// view of the world serves controller and judge.
bool controller_sees_all(const scene::Scene& scene) {
  const bool exact =
      scene.actuation.joint_noise_rad == 0.0 && scene.actuation.planner_mass_scale == 1.0;
  return exact && !(scene.map && !scene.map->changes.empty()) &&
         std::all_of(scene.obstacles.begin(), scene.obstacles.end(),
                     [](const auto& o) { return o.known && !o.judge_only; });
}

model::Model load_checked(const scene::Scene& scene) {
  model::Model model = control::load_model(scene);
  control::check_numbers(scene, model);
  return model;
}

/// CPU time of a tick without writing its log line.
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
                       const std::vector<std::filesystem::path>& plugin_directories)
    : scene_(scene),
      model_(load_checked(scene)),
      options_(integrator_options(scene.integrator.params, scene.name + ": /integrator/params")),
      arm_(scene, model_, options_),
      noise_(scene.seed),
      q_measured_(VectorXd::Zero(model_.dof())) {
  result_.warnings = model::warnings(model_.robot());
  const planning::Plugin plugin = control::find_planner(scene, plugin_directories);
  planner_params_ = control::planner_params(scene, plugin);
  steps_ =
      in_scene(scene, "/duration_s", [&] { return step_count(scene.duration_s, scene.step_s); });
  actuation_ = make_actuation(scene, arm_);
  control::Controller::Options options;
  options.obstacles_max = 0;  // no more than the scene's
  options.prepare_maps = false;
  options.path_points_max = 0;  // no more than the scene's
  options.certify = false;      // the judge does, for every step and with all obstacles
  options.torque = scene.actuation.type == scene::ActuationType::sampled;
  options.period_s = static_cast<double>(steps_per_tick(scene)) * scene.step_s;
  options.log_overrun = false;  // counted in the result; a log must not depend on the clock
  options.log = [this](std::int32_t level, std::string_view line) {
    log_planner_message(level, line);
  };
  controller_ = std::make_unique<control::Controller>(scene, model_, plugin, planner_params_,
                                                      std::move(options));
  if (!controller_sees_all(scene))
    own_judge_ =
        std::make_unique<control::WorldView>(scene, model_, controller_->view().influence_m());
  judge_ = own_judge_ ? own_judge_.get() : &controller_->view();
  if (judge_->has_self() && !judge_->self_field()->note().empty())
    result_.warnings.push_back(judge_->self_field()->note());
  arm_.channels.gyroscopic.reserve(controller_->view().contacts_max());
  inputs_ = all_inputs(scene, plugin);
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
  recorder_->event(arm_.state.time_s, text);
  if (watch_->diagnostics)
    watch_->diagnostics->log(warning ? spdlog::level::warn : spdlog::level::debug, text);
}

bool ClosedLoop::has_diagnostics(int level) const {
  return watch_ != nullptr && watch_->diagnostics &&
         watch_->diagnostics->should_log(static_cast<spdlog::level::level_enum>(level));
}

void ClosedLoop::start(const Watch& watch) {
  watch_ = &watch;
  recorder_ = std::make_unique<Recorder>(result_, watch, *arm_.integrator);
  const bool ideal = scene_.actuation.type == scene::ActuationType::ideal;
  audit_ = std::make_unique<EnergyAudit>(*recorder_,
                                         ideal && arm_.integrator->name() == "hamel-variational");
  log_ = std::make_unique<TickLog>(*recorder_, arm_, *judge_, controller_->goals(), *actuation_);
  result_.provenance = log::provenance(inputs_, watch.argv);
  if (recorder_->logging())
    log_->header(scene_, controller_->plugin(), planner_params_, controller_->series(),
                 result_.provenance, steps_);
  for (const auto& line : early_messages_) report_event(line.warning, line.text);
  min_clearance_ = judge_->influence_m();
  min_self_clearance_ = judge_->self_influence_m();
  warn_of_goals_in_contact(watch);
}

log::Result ClosedLoop::run(const Watch& watch) {
  start(watch);
  while (!done_) {
    TickTimer timer;
    if (own_judge_) timer.pause();  // what only the judge does is no part of a tick
    observe_node();
    if (own_judge_) timer.resume();
    check_outcome();
    if (done_)
      book_last_node();
    else if (actuation_->asks_planner(arm_.state.k))
      ask_planner();
    if (!done_) apply_answer();
    timer.pause();
    write_tick();
    timer.resume();
    if (done_) break;
    step();
    if (!done_) recorder_->tick_time(timer.spent_s());
  }
  fill_result();
  recorder_->close(audit_->ledger());
  return result_;
}

void ClosedLoop::observe_node() {
  actuation_->reach_node(arm_);
  judge_->look(arm_.state.q, arm_.state.time_s);
  reveal_obstacles();
  min_clearance_ = std::min(min_clearance_, judge_->clearance_m());
  min_self_clearance_ = std::min(min_self_clearance_, judge_->self_clearance_m());
  touching_ = judge_->touching();
  if (arm_.state.k > 0 && (judge_->has_obstacles() || judge_->has_self())) certify();
  change_map();
  recorder_->observe(judge_->clearance_m(), certified_, arm_.v, scene_.step_s);
  if (watch_->at_node) watch_->at_node(arm_.state.time_s, arm_.state.q);
}

void ClosedLoop::certify() {
  const auto verdict = judge_->certify(arm_.state.q, arm_.v);
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
                                              arm_.state.k - 1, arm_.state.k));
}

void ClosedLoop::reveal_obstacles() {
  for (const int found : judge_->revealed()) {
    scene::Obstacle obstacle = judge_->environment().obstacles()[static_cast<std::size_t>(found)];
    recorder_->event(arm_.state.time_s,
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
       changes[next_map_change_].time_s <= arm_.state.time_s + 1e-9;
       ++next_map_change_)
    controller_->world().change_map(changes[next_map_change_]);
  judge_->look(arm_.state.q, arm_.state.time_s);
  min_clearance_ = std::min(min_clearance_, judge_->clearance_m());
  touching_ = touching_ || judge_->clearance_m() <= 0.0;
}

void ClosedLoop::check_outcome() {
  const auto& state = arm_.state;
  if (!arm_.v.allFinite() || !state.q.allFinite())
    return finish(log::Outcome::diverged,
                  fmt::format("step {}: the state is no longer finite", state.k));
  if (touching_ && state.k > 0) return finish(log::Outcome::collision, judge_->describe_contact());
  if (touching_) return refuse();
  if (done_) return;
  const bool tick = actuation_->asks_planner(state.k);
  if (tick) let_controller_observe();
  const control::ControlState now = controller_->answer().state;
  if (now == control::ControlState::reached)
    finish(log::Outcome::reached, "");
  else if (tick && now == control::ControlState::stalled)
    finish(log::Outcome::stalled,
           fmt::format("at rest for {} s away from the goal", scene_.stall->hold_s));
  else if (state.k == steps_)
    finish(log::Outcome::timeout, fmt::format("goal not reached within {} s", scene_.duration_s));
  else if (recorder_->stopped(state.k))
    finish(log::Outcome::interrupted, "stopped from outside");
}

void ClosedLoop::refuse() {
  std::string cause = judge_->describe_contact();
  if (judge_->clearance_m() > 0.0)
    cause += fmt::format("; {}", scene::self_contact_remedy(scene_.robot));
  finish(log::Outcome::refused, std::move(cause));
}

void ClosedLoop::let_controller_observe() {
  observed_k_ = arm_.state.k;
  q_measured_ = arm_.state.q;
  if (scene_.actuation.joint_noise_rad > 0.0 &&
      scene_.actuation.type == scene::ActuationType::sampled)
    for (auto& angle : q_measured_) angle += scene_.actuation.joint_noise_rad * noise_.normal();
  controller_->observe(arm_.state.time_s, q_measured_, arm_.v);
  const control::GoalTracker& goals = controller_->goals();
  while (goals_reached_ < goals.index())
    recorder_->event(arm_.state.time_s,
                     fmt::format("goal {} of {} reached", ++goals_reached_, goals.size()));
}

void ClosedLoop::ask_planner() {
  controller_->decide();
  recorder_->planner_time(controller_->answer().planner_s);
  if (planner_answered() && controller_->answer().state == control::ControlState::gave_up)
    finish(log::Outcome::stalled, std::string(controller_->answer().cause));
  if (done_ && !actuation_->needs_answer_at_end()) book_last_node();
}

bool ClosedLoop::planner_answered() {
  const control::Answer& answer = controller_->answer();
  if (answer.channels != nullptr) return true;
  finish(log::Outcome::defect, fmt::format("planner '{}' at step {}: {}", scene_.planner->name,
                                           arm_.state.k, answer.cause));
  return false;
}

void ClosedLoop::apply_answer() {
  const planning::CommandBuffers& channels = *controller_->answer().channels;
  actuation_->book(arm_, channels, *audit_);
  finish_if(audit_->fault(arm_));
  const std::string fault = audit_->fault_of_planner(channels.raw());
  if (!fault.empty())
    finish_if(
        fmt::format("planner '{}' at step {}: {}", scene_.planner->name, arm_.state.k, fault));
  if (!done_) actuation_->apply(arm_, controller_->answer(), *audit_);
}

// Only the planner knows a control potential's value and its gradient for the closing half-kick.
void ClosedLoop::book_last_node() {
  if (arm_.state.k == 0 || result_.outcome == log::Outcome::diverged) return;
  if (!actuation_->needs_answer_at_end()) {
    audit_->book_node(arm_);
  } else {
    if (observed_k_ != arm_.state.k) let_controller_observe();
    controller_->decide();
    if (controller_->answer().channels == nullptr) return;
    actuation_->book(arm_, *controller_->answer().channels, *audit_);
  }
  if (result_.outcome != log::Outcome::collision) finish_if(audit_->fault(arm_));
}

void ClosedLoop::write_tick() {
  if (recorder_->wants_tick(arm_.state.k) || (done_ && recorder_->logging()))
    log_->tick(certified_, done_ ? nullptr : controller_->answer().channels);
}

void ClosedLoop::step() {
  judge_->depart(arm_.state.q, actuation_->departure_velocity(arm_));
  if (actuation_->saturated()) ++saturated_steps_;
  const bool converged = arm_.step(scene_.step_s);
  recorder_->step(arm_.report);
  if (!converged) {
    finish(log::Outcome::diverged,
           fmt::format("step {} of {} s found no root", arm_.state.k + 1, scene_.step_s));
    if (recorder_->logging()) log_->tick(certified_, nullptr);
    return;
  }
  audit_->book_step(arm_.report);
  recorder_->progress(arm_.state.k, arm_.state.time_s, scene_.duration_s);
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
  result_.scene = scene_.name;
  result_.planner = controller_->plugin().name();
  result_.time_s = arm_.state.time_s;
  result_.steps = arm_.state.k;
  result_.q = arm_.state.q;
  result_.v = arm_.v;
  result_.seed = scene_.seed;
  result_.deadline_us = 1e6 * controller_->deadline_s();
  result_.late_ticks = controller_->answer().overruns;
  dynamics::forward_kinematics(model_, arm_.ws, arm_.state.q);
  const control::GoalTracker& goals = controller_->goals();
  const control::GoalError error = goals.error(arm_.ws, arm_.state.q, arm_.v);
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
  if (actuation_->limited() && arm_.state.k > 0) {
    result_.saturated_share =
        static_cast<double>(saturated_steps_) / static_cast<double>(arm_.state.k);
    if (saturated_steps_ > 0)
      result_.warnings.push_back(
          fmt::format("torque limits cut the planner's answer in {} of {} steps", saturated_steps_,
                      arm_.state.k));
  }
}

}  // namespace hamelin::simulation

#include "hamelin/control/controller.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <utility>

#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "line_buffer.hpp"

namespace hamelin::control {

using Eigen::VectorXd;

namespace {

// The longest path of goals that are set later, if the caller gives no other.
constexpr std::size_t default_path_points = 256;
// The longest path of a guide.
constexpr std::size_t guide_path_points = 256;
// The longest time between two ticks: an arm that is told less often is not controlled [s].
constexpr double period_max_s = 1.0;
// Larger numbers are neither positions nor velocities of a joint [rad or m, rad/s or m/s]: what
// follows from them may overflow.
constexpr double measured_max = 1e6;

// Also false for numbers that are not finite.
bool within(const VectorXd& x, double bound) {
  return (x.array().abs() <= bound).all();
}

double period_of(const scene::Scene& scene, const ControllerOptions& options) {
  const double period = options.period_s.value_or(
      scene.actuation.type == scene::ActuationType::ideal ? scene.step_s
                                                          : scene.actuation.control_period_s);
  if (!(period > 0.0 && period <= period_max_s))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: period_s: {}, expected more than 0 and at most {} s", scene.name,
                            period, period_max_s));
  return period;
}

// A shield is chosen, and its bounds are, by what the controller drives and what its world may come
// to contain, not by what the scene was written for.
scene::Scene in_force(scene::Scene scene, const ControllerOptions& options) {
  if (options.position)
    scene.actuation.type = scene::ActuationType::position;
  else if (options.ideal_arm == nullptr && scene.actuation.type == scene::ActuationType::ideal)
    scene.actuation.type = scene::ActuationType::sampled;
  if (!scene.safety.type)
    scene.safety.type = options.fixed_world ? scene::safety_type(scene) : scene::SafetyType::shield;
  return scene;
}

// One positive number for all joints, or one per joint.
VectorXd positive_per_joint(const scene::Scene& scene, const std::vector<double>& values,
                            const char* key, int dof) {
  const std::string place = fmt::format("{}: {}", scene.name, key);
  for (const double x : values)
    if (!std::isfinite(x) || x <= 0.0)
      throw Error(ErrorCode::invalid, fmt::format("{}: {}, expected positive numbers", place, x));
  return one_or_per_joint(values, dof, place);
}

void check_follows(const scene::Scene& scene, const planning::Plugin& plugin) {
  for (std::size_t i = 0; i < scene.goals.size(); ++i)
    if (scene.goals[i].trajectory && !plugin.follows_trajectories())
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: /goals/{}: is a trajectory, which planner '{}' does not follow, "
                              "expected one that does, such as hybrid, or a goal of type path",
                              scene.name, i, plugin.name()));
  if (follow_goal_of(scene.goals) == nullptr || plugin.follows_targets()) return;
  throw Error(ErrorCode::invalid,
              fmt::format("{}: /goals/{}: follows a target, which planner '{}' does not support, "
                          "expected one that does, such as hybrid",
                          scene.name, scene.goals.size() - 1, plugin.name()));
}

DriveOptions drive_options(const scene::Scene& scene, const ControllerOptions& options,
                           double period_s, int dof) {
  DriveOptions out;
  if (options.position)
    out.kind = DriveKind::position;
  else
    out.kind = options.ideal_arm == nullptr ? DriveKind::torque : DriveKind::ideal;
  out.arm = options.ideal_arm;
  out.period_s = period_s;
  out.delay_periods = static_cast<std::size_t>(std::round(scene.actuation.delay_s / period_s));
  out.acceleration_max =
      positive_per_joint(scene, options.acceleration_max, "acceleration_max", dof);
  out.jerk_max = positive_per_joint(scene, options.jerk_max, "jerk_max", dof);
  out.tracking_max = positive_per_joint(scene, options.tracking_max, "tracking_max", dof);
  return out;
}

World::Options world_options(const scene::Scene& scene, const model::Model& arm,
                             const ControllerOptions& options, std::optional<double> influence_m) {
  const scene::PayloadBounds bounds =
      scene::payload_bounds(scene.events, arm, scene.name + ": /events");
  World::Options out{influence_m.value_or(default_influence_m), options.obstacles_max,
                     options.prepare_maps, options.observations};
  out.payload_reach_m = options.payload_reach_m.value_or(bounds.reach_m);
  out.payload_shapes = options.payload_shapes_max.value_or(bounds.shapes);
  return out;
}

model::Model nominal_of(const scene::Scene& scene, const model::Model& arm) {
  check_numbers(scene, arm);
  return scaled_masses(arm, scene.actuation.planner_mass_scale);
}

}  // namespace

Controller::Controller(const std::filesystem::path& scene_file,
                       const std::vector<std::filesystem::path>& plugin_directories,
                       Options options)
    : Controller(scene::read_scene(scene_file), plugin_directories, std::move(options)) {}

Controller::Controller(const scene::Scene& scene,
                       const std::vector<std::filesystem::path>& plugin_directories,
                       Options options)
    : Controller(scene, load_model(scene), find_planner(scene, plugin_directories),
                 std::move(options)) {}

Controller::Controller(const scene::Scene& scene, const model::Model& arm,
                       const planning::Plugin& plugin, Options options)
    : Controller(scene, arm, plugin, control::planner_params(scene, plugin), std::move(options)) {}

Controller::Controller(const scene::Scene& given, const model::Model& arm,
                       const planning::Plugin& plugin, const Json& params, Options options)
    : options_(std::move(options)),
      scene_(in_force(given, options_)),
      period_s_(period_of(scene_, options_)),
      deadline_s_(scene_.actuation.deadline_s.value_or(period_s_)),
      path_points_max_(std::max(
          {longest_path(scene_.goals), options_.path_points_max.value_or(default_path_points),
           scene_.guide.type != scene::GuideType::none ? guide_path_points : std::size_t{0}})),
      plugin_(plugin),
      nominal_(nominal_of(scene_, arm)),
      drive_options_(drive_options(scene_, options_, period_s_, nominal_.dof())),
      world_(scene_, nominal_,
             world_options(scene_, nominal_, options_, plugin.influence_m(params))),
      params_(params),
      arm_(std::make_unique<LoadedArm>(scene_, nominal_, params_, common())),
      newest_goals_(scene_.goals),
      newest_arm_(arm_.get()),
      measured_(static_cast<std::size_t>(nominal_.dof())),
      new_goals_(std::make_unique<GoalList>(0, scene_.goals)),
      new_params_(std::make_unique<NewParams>()),
      new_load_(std::make_unique<NewLoad>()),
      new_stop_(std::make_unique<StopRequest>()),
      goal_list_(&new_goals_.take()),
      new_target_(std::make_unique<StreamedTarget>()),
      reference_(nominal_.dof()),
      goals_(goal_list_->goals, scene_.stall, arm_->model) {
  check_follows(scene_, plugin);
  expect_target(scene_.goals);
  answer_.torque = answer_.q_next = answer_.v_next = VectorXd::Zero(nominal_.dof());
  make_guidance();
}

void Controller::make_guidance() {
  guidance_number_ = 0;
  if (arm_->guide)
    guidance_.emplace(scene_.guide, nominal_.dof(), static_cast<Eigen::Index>(path_points_max_),
                      plugin_.follows_paths(), !options_.guide_thread);
}

LoadedArm::Common Controller::common() noexcept {
  return {plugin_,        world_,         options_.log,         path_points_max_,
          drive_options_, time_s_.load(), options_.guide_thread};
}

double steady_clock_s() {
  const std::chrono::duration<double> time = std::chrono::steady_clock::now().time_since_epoch();
  return time.count();
}

void Controller::reset() {
  const std::lock_guard load_lock(load_mutex_);
  const std::lock_guard goals_lock(goals_mutex_);
  k_ = 0;
  shielded_ = false;
  late_answers_ = unusable_ = 0;
  answer_.overruns = 0;
  answer_.saturated = answer_.stopping = false;
  answer_.state = ControlState::running;
  answer_.reason = StopReason::none;
  answer_.cause = lost_ = {};
  stopped_ = begun_stop_ = 0;
  verdict_.reset();
  goals_.restart();
  expect_target(newest_goals_);
  target_.stop();
  reference_.stop();
  make_guidance();
  scene::Scene scene = scene_;
  scene.goals = newest_goals_;
  reset_ = !arm_->restart(std::move(scene), params_, common());
  if (reset_) return;
  used_params_ = params_number_;
  goal_ = {};
  listed_ = nullptr;
}

const Answer& Controller::tick(double time_s, const VectorXd& q, const VectorXd& v) {
  observe(time_s, q, v);
  decide();
  return answer_;
}

const Answer& Controller::tick_unseen() {
  if (k_ == 0) throw Error(ErrorCode::usage, "tick_unseen: the first tick needs a measurement");
  usable_ = false;
  ++unusable_;
  if (lost_.empty()) {
    lost_line_.clear();
    append(lost_line_, "no measurement came, expected one in each period of {} s", period_s_);
    lost_ = lost_line_.view();
  }
  time_s_ = time_s_ + period_s_;
  arm_->drive->measure(q(), v(), false);
  look(false);
  decide();
  return answer_;
}

void Controller::observe(double time_s, const VectorXd& q, const VectorXd& v) {
  const bool first = k_ == 0;
  measure(time_s, q, v);
  look(first);
}

void Controller::look(bool first) {
  verdict_.reset();
  if (options_.certify && !first) {  // against the world in which the arm moved
    arm_->view.look(this->q(), time_s_);
    verdict_ = arm_->view.certify(this->q(), this->v());
    if (arm_->view.take_newest()) arm_->view.look(this->q(), time_s_);
  } else {
    (void)arm_->view.take_newest();
    arm_->view.look(this->q(), time_s_);
  }
  take_load();
  take_stop();
  answer_.snapshot = arm_->view.snapshot();
  take_goals();
  answer_.goals_number = goal_list_->number;
  if (answer_.state == ControlState::stopping) return;
  answer_.state = ControlState::running;
  answer_.cause = {};
  update_reference();
  while (!reference_.on_the_way() && goals_.advance(arm_->view.poses(), this->q(), this->v()))
    update_reference();
  answer_.goal_index = goals_.index();
  update_target();
  if (goals_.all_reached())
    answer_.state = ControlState::reached;
  else if (!(guidance_ && guidance_->waits()) && !arm_->planner.detects_stalls() &&
           goals_.stalled(arm_->view.poses(), this->v(), period_s_)) {
    if (guidance_ && guidance_->stalled())
      goals_.forget_rest();
    else
      answer_.state = ControlState::stalled;
  }
}

void Controller::measure(double time_s, const VectorXd& q, const VectorXd& v) {
  const Eigen::Index dof = nominal_.dof();
  const bool uses_v = !scene_.actuation.estimates_velocity;
  if (q.size() != dof || (uses_v && v.size() != dof))
    throw Error(ErrorCode::invalid,
                fmt::format("the measured q and v: {} and {} values given, expected {} each (one "
                            "per joint of '{}')",
                            q.size(), v.size(), dof, nominal_.robot().name));
  const bool in_order = std::isfinite(time_s) && (k_ == 0 || time_s >= given_s_),
             finite = within(q, measured_max) && (!uses_v || within(v, measured_max));
  usable_ = in_order && finite;
  unusable_ = usable_ ? 0 : unusable_ + 1;
  if (!usable_)
    lose_measurement(time_s, in_order);
  else if (answer_.state != ControlState::stopping)
    lost_ = {};
  // what moves goes on as predicted while the clock cannot be used
  if (!in_order)
    time_s_ = time_s_ + period_s_;
  else
    time_s_ = k_ == 0 ? time_s : std::max(time_s, time_s_.load());
  if (in_order) given_s_ = time_s;
  if (finite)
    for (Eigen::Index i = 0; i < dof; ++i)
      measured_[static_cast<std::size_t>(i)].store(q[i], std::memory_order_relaxed);
  // where the clock is broken for good, the arm is brought to rest by what is measured
  arm_->drive->measure(q, v, finite && (in_order || unusable_ > options_.lost_measurements_max));
}

// The first line stays: it says why the arm stops.
void Controller::lose_measurement(double time_s, bool in_order) {
  if (!lost_.empty()) return;
  LineBuffer& line = lost_line_;
  line.clear();
  if (in_order)
    append(line,
           "the measured q or v is not finite, or beyond {} rad or m, expected what the joints "
           "have measured",
           measured_max);
  else if (std::isfinite(time_s))
    append(line, "time_s: {} is before that of the last tick, {}, expected times that do not fall",
           time_s, time_s_.load());
  else
    append(line, "time_s: is not finite, expected the time of the measurement");
  if (k_ == 0) throw Error(ErrorCode::invalid, std::string(line.view()));
  lost_ = line.view();
}

void Controller::decide() {
  Drive& drive = *arm_->drive;
  if (k_ == 0) drive.start();
  if (arm_->shield && !shielded_) {
    arm_->shield->start(surroundings(), drive.node());
    shielded_ = true;
  }
  if (answer_.state != ControlState::stopping) check_arm();
  if (answer_.state != ControlState::stopping) ask_planner();
  answer_.series = arm_->planner.command().series();
  propose();
  act();
  const Setpoint& sent = drive.send();
  answer_.torque = sent.torque;
  answer_.saturated = sent.saturated;
  answer_.q_next = sent.q;
  answer_.v_next = sent.v;
  if (options_.certify) arm_->view.depart(q(), v());
  ++k_;
}

void Controller::check_arm() {
  if (unusable_ > options_.lost_measurements_max)
    return start_braking(StopReason::measurement, lost_);
  LineBuffer defect;
  arm_->drive->describe_defect(defect);
  if (!defect.view().empty()) start_braking(StopReason::tracking, defect.view());
}

void Controller::ask_planner() {
  take_params();
  if (reset_) arm_->planner.reset(q(), v());
  const std::size_t index = std::min(goals_.index(), goals_.size() - 1);
  const hamelin_goal* const listed = &goal_list_->for_planner[index];
  if (reset_ || (listed_ != nullptr && listed_ != listed)) {
    ++goal_.number;
    ++listed_number_;
  }
  listed_ = listed;
  if (guidance_) update_guidance();
  goal_ = {goal_for_planner(), goal_.number, index};
  reset_ = false;
  const double since_s = options_.clock_s != nullptr ? options_.clock_s() : 0.0;
  if (!arm_->planner.tick(k_, time_s_, q(), v(), goal_, arm_->drive->last_torque()))
    return start_braking(StopReason::planner, arm_->planner.error());
  if (options_.clock_s != nullptr) note_time(options_.clock_s() - since_s);
  if (answer_.state == ControlState::stopping || !arm_->planner.gave_up() ||
      (guidance_ && guidance_->stalled()))
    return;
  answer_.state = ControlState::gave_up;
  answer_.cause = arm_->planner.command().raw().cause;
}

void Controller::note_time(double planner_s) {
  answer_.planner_s = planner_s;
  late_answers_ = planner_s > deadline_s_ ? late_answers_ + 1 : 0;
  if (late_answers_ > 0 && ++answer_.overruns == 1) log_first_overrun();
  if (options_.late_answers_max == 0 || late_answers_ < options_.late_answers_max) return;
  LineBuffer line;
  append(line,
         "the last {} answers were late, expected answers within {} s; the last one took {:.3g} s",
         late_answers_, deadline_s_, planner_s);
  start_braking(StopReason::late, line.view());
}

// Later ones are counted only: an arm that is always late would fill a log.
void Controller::log_first_overrun() {
  if (!options_.log || !options_.log_overrun) return;
  LineBuffer line;
  append(line,
         "planner '{}' took {:.3g} s in the tick at {} s, expected at most its deadline of {} s; "
         "later overruns are only counted",
         plugin().name(), answer_.planner_s, time_s_.load(), deadline_s_);
  options_.log(HAMELIN_LOG_WARNING, line.view());
}

// The cause is copied: its planner may be gone while the arm is still held.
void Controller::start_braking(StopReason reason, std::string_view cause) {
  LineBuffer line;
  append(line, "{}", cause);
  cause_line_ = line;
  answer_.state = ControlState::stopping;
  answer_.reason = reason;
  answer_.cause = cause_line_.view();
  stopped_ = ++stops_;
}

void Controller::propose() {
  answer_.channels = answer_.state == ControlState::stopping ? nullptr : &arm_->planner.command();
  if (answer_.channels == nullptr || arm_->drive->propose(*answer_.channels)) return;
  start_braking(
      StopReason::planner,
      "the sum of the planner's channels is no torque or acceleration of an arm, expected finite "
      "numbers below 1e12");
  answer_.channels = nullptr;
}

void Controller::act() {
  answer_.stopping = false;
  Drive& drive = *arm_->drive;
  if (Shield* const shield = arm_->shield.get()) {
    const auto step = answer_.channels != nullptr ? drive.step() : std::nullopt;
    if (!step)
      shield->refuse();
    else if (shield->accept(surroundings(), *step))
      return;
    answer_.stopping = true;
  } else {
    if (answer_.channels != nullptr) return;
    if (begun_stop_ != stopped_) drive.begin(arm_->stop());
    begun_stop_ = stopped_;
  }
  drive.follow(arm_->stop());
}

}  // namespace hamelin::control

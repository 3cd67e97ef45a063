// How a controller is made, made again, and looked at.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "guide/guidance.hpp"
#include "hamelin/control/controller.hpp"
#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "loop/goal_list.hpp"
#include "loop/loaded_arm.hpp"
#include "loop/mailbox.hpp"
#include "loop/path_reference.hpp"

namespace hamelin::control {

using Eigen::VectorXd;

namespace {

// The longest path of goals that are set later, if the caller gives no other.
constexpr std::size_t default_path_points = 256;
// The longest path of a guide.
constexpr std::size_t guide_path_points = 256;
// The longest time between two ticks: an arm that is told less often is not controlled [s].
constexpr double period_max_s = 1.0;

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
  for (std::size_t i = 0; i < scene.goals.size(); ++i) {
    const std::string defect = path_defect(scene.goals[i], scene, plugin);
    if (!defect.empty())
      throw Error(ErrorCode::invalid, fmt::format("{}: /goals/{}: {}", scene.name, i, defect));
    if (scene.goals[i].trajectory && !plugin.follows_trajectories())
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: /goals/{}: is a trajectory, which planner '{}' does not follow, "
                              "expected one that does, such as hybrid, or a goal of type path",
                              scene.name, i, plugin.name()));
  }
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
           searches_paths(scene_, plugin) ? guide_path_points : std::size_t{0}})),
      plugin_(plugin),
      nominal_(nominal_of(scene_, arm)),
      drive_options_(std::make_unique<DriveOptions>(
          drive_options(scene_, options_, period_s_, nominal_.dof()))),
      world_(scene_, nominal_,
             world_options(scene_, nominal_, options_, plugin.influence_m(params))),
      params_(params),
      arm_(std::make_unique<LoadedArm>(scene_, nominal_, params_, arm_setup())),
      newest_goals_(scene_.goals),
      newest_arm_(arm_.get()),
      measured_(static_cast<std::size_t>(nominal_.dof())),
      mail_(std::make_unique<Mailbox>(first_goals())),
      goal_list_(&mail_->goals.take()),
      reference_(nominal_.dof()),
      path_reference_(std::make_unique<PathReference>(nominal_.dof())),
      goals_(goal_list_->goals, scene_.stall, arm_->model) {
  check_follows(scene_, plugin);
  keep_motions(0, goal_list_->motions);
  expect_target(scene_.goals);
  answer_.torque = answer_.q_next = answer_.v_next = VectorXd::Zero(nominal_.dof());
  make_guidance();
}

std::unique_ptr<GoalList> Controller::first_goals() {
  std::vector<std::uint64_t> allowances = world_.allow(allowances_of(scene_.goals));
  GoalList::Motions motions = arm_->certify(scene_.goals, allowances, arm_setup());
  return std::make_unique<GoalList>(0, scene_.goals, std::move(allowances), std::move(motions), 0);
}

void Controller::make_guidance() {
  guidance_number_ = 0;
  if (arm_->guide)
    guidance_ = std::make_unique<Guidance>(scene_.guide, nominal_.dof(),
                                           static_cast<Eigen::Index>(path_points_max_),
                                           plugin_.follows_paths(), !options_.guide_thread);
}

ArmSetup Controller::arm_setup() noexcept {
  return {plugin_,         world_,         options_.log,         path_points_max_,
          *drive_options_, time_s_.load(), options_.guide_thread};
}

Controller::~Controller() = default;

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
  path_reference_->stop();
  forsaken_ = nullptr;
  make_guidance();
  scene::Scene scene = scene_;
  scene.goals = newest_goals_;
  reset_ = !arm_->restart(std::move(scene), params_, arm_setup());
  if (reset_) return;
  used_params_ = params_number_;
  goal_ = {};
  listed_ = nullptr;
}

void Controller::run_guide() {
  if (arm_->guide) arm_->guide->run();
}

const GuideFigures* Controller::guide_figures() const noexcept {
  return guidance_ ? &guidance_->figures() : nullptr;
}

std::string_view Controller::guide_cause() const noexcept {
  return guidance_ && guidance_->waits() ? guidance_->cause() : std::string_view();
}

std::optional<ShieldReport> Controller::shield_report() const {
  const Shield* const shield = arm_->shield.get();
  if (shield == nullptr) return std::nullopt;
  ShieldReport out;
  out.stopping = shield->stopping();
  if (out.stopping) out.cause = shield->refusal().cause;
  out.began = shield->stop_began();
  out.at_rest = shield->stop().at_rest();
  out.along_path = shield->stop().motion().along_path();
  out.evades = shield->stop().motion().moves();
  out.stop_end = &shield->stop().motion().end();
  out.proof = shield->mover_proof();
  out.largest_margin_m = shield->largest_margin_m();
  out.counts = shield->counts();
  return out;
}

void Controller::describe_refusal(LineBuffer& line) const {
  const Shield* const shield = arm_->shield.get();
  if (shield != nullptr && shield->stopping()) shield->describe(arm_->view.environment(), line);
}

Shield* Controller::shield() noexcept {
  return arm_->shield.get();
}

const Shield* Controller::shield() const noexcept {
  return arm_->shield.get();
}

Surroundings Controller::surroundings() const noexcept {
  return {arm_->view.environment(), arm_->view.snapshot(), time_s_, arm_->view.standing()};
}

WorldView& Controller::view() noexcept {
  return arm_->view;
}

const WorldView& Controller::view() const noexcept {
  return arm_->view;
}

const model::Model& Controller::model() const noexcept {
  return arm_->model;
}

const VectorXd& Controller::q() const noexcept {
  return arm_->drive->q();
}

const VectorXd& Controller::v() const noexcept {
  return arm_->drive->v();
}

const std::vector<planning::Series>& Controller::series() const noexcept {
  return arm_->planner.series();
}

const Drawing& Controller::drawing() const noexcept {
  return arm_->planner.drawing();
}

geometry::SE3 Controller::tip() const {
  return dynamics::tip_pose(arm_->model, arm_->view.poses());
}

}  // namespace hamelin::control

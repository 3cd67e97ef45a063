#include "plugin_trial.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <memory>
#include <thread>
#include <utility>

#include "hamelin/control/controller.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/allocation_count.hpp"
#include "hamelin/integration/integrator.hpp"
#include "hamelin/model/make_chain.hpp"

namespace hamelin::app {

using Eigen::VectorXd;

namespace {

constexpr double period_s = 0.001;

int thread_count() {
  int count = 0;
  std::error_code ignored;
  for (std::filesystem::directory_iterator it("/proc/self/task", ignored), end; it != end;
       it.increment(ignored))
    ++count;
  return count;
}

void append(std::vector<std::uint64_t>& bytes, const double* numbers, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) bytes.push_back(std::bit_cast<std::uint64_t>(numbers[i]));
}

void append(std::vector<std::uint64_t>& bytes, const control::Answer& answer) {
  const auto vector = [&](const VectorXd& x) {
    append(bytes, x.data(), static_cast<std::size_t>(x.size()));
  };
  vector(answer.torque);
  bytes.push_back(static_cast<std::uint64_t>(answer.state));
  if (answer.channels == nullptr) return;
  for (const auto* x : {&answer.channels->potential_gradient(), &answer.channels->damping(),
                        &answer.channels->held_torque(), &answer.channels->node_velocity()})
    vector(*x);
  for (const auto& term : answer.channels->gyroscopic()) append(bytes, term.w_world, 3);
  append(bytes, answer.series.data(), answer.series.size());
}

control::Controller::Options options_of_trial() {
  control::Controller::Options options;
  options.obstacles_max = 8;
  options.period_s = period_s;
  options.clock_s = control::steady_clock_s;
  options.late_answers_max = 0;  // late answers are a finding, no failure
  options.guide_thread = false;  // threads are the planner's then
  return options;
}

/// An arm that is simulated, and the planner that moves it.
class Loop {
 public:
  Loop(const planning::Plugin& plugin, const Json& params, const TrialScene& trial)
      : trial_(trial),
        start_q_(trial.scene.start_q.size() > 0 ? trial.scene.start_q
                                                : VectorXd::Zero(trial.arm.dof())),
        params_(params),
        controller_(trial.scene, trial.arm, plugin, params, options_of_trial()),
        integrator_(integration::make_integrator("semi-implicit-euler", trial.arm)) {
    restart();
  }
  void restart() {
    state_ = integrator_->start(start_q_, VectorXd::Zero(trial_.arm.dof()));
    v_.setZero(trial_.arm.dof());
  }
  [[nodiscard]] control::Controller& controller() { return controller_; }

  /// @return whether the planner's answer is valid
  bool tick(Trial& out, std::vector<std::uint64_t>& answers) {
    const long before = allocation_count();
    const control::Answer& answer = controller_.tick(state_.time_s, state_.q, v_);
    const long made = allocation_count() - before;
    if (made > 0 && out.allocating_tick < 0) out.allocating_tick = state_.k;
    out.allocations += made;
    if (answer.state == control::ControlState::stopping) {
      out.failure = fmt::format("tick {}: {}", state_.k, answer.cause);
      return false;
    }
    append(answers, answer);
    out.tick_s.push_back(answer.planner_s);
    controller_.run_guide();
    step(answer.torque);
    return true;
  }

  /// What happens while the planner runs.
  void change(long k) {
    control::World& world = controller_.world();
    scene::Obstacle ball;
    ball.name = "ball of the trial";
    ball.radius_m = 0.05;
    ball.pose = {Eigen::Matrix3d::Identity(), {0.1, 0.45, 0.3}};
    if (k == 60) controller_.set_goals(other_goals());
    if (k == 90) world.set_obstacle(ball);
    if (k == 120) world.move_obstacle(ball.name, ball.pose, {0.0, 0.0, -0.2}, state_.time_s);
    if (k == 150) world.remove_obstacle(ball.name);
    if (k == 180 && controller_.plugin().can_change_params())
      controller_.set_planner_params(params_);
  }

 private:
  // Back to the start along a path, then a pose near it.
  [[nodiscard]] std::vector<scene::Goal> other_goals() const {
    scene::Goal back = scene::joint_goal(start_q_);
    back.path.resize(start_q_.size(), 3);
    back.path << state_.q, 0.5 * (state_.q + start_q_), start_q_;
    dynamics::Workspace ws(trial_.arm);
    dynamics::forward_kinematics(trial_.arm, ws, start_q_);
    return {back, scene::pose_goal(dynamics::tip_pose(trial_.arm, ws))};
  }
  // A planner may command what an integrator cannot follow; the arm then stays where it is.
  void step(const VectorXd& torque) {
    channels_.held_torque = torque;
    const integration::State before = state_;
    if (!integrator_->step(state_, channels_, period_s).converged || !state_.q.allFinite())
      state_ = before;
    state_.k = before.k + 1;
    state_.time_s = period_s * static_cast<double>(state_.k);
    integrator_->velocity(state_, v_);
    if (!v_.allFinite()) v_.setZero();
  }

  const TrialScene& trial_;
  VectorXd start_q_;
  Json params_;
  control::Controller controller_;
  std::unique_ptr<integration::Integrator> integrator_;
  integration::State state_;
  integration::Channels channels_;
  VectorXd v_;
};

scene::Scene scene_beside_ball(const scene::Goal& goal) {
  scene::Scene scene;
  scene.name = "a chain of three links beside a ball";
  scene.start_q = Eigen::Vector3d(0.1, 0.2, -0.1);
  scene.goals = {goal};
  scene.actuation.type = scene::ActuationType::sampled;
  scene.actuation.control_period_s = scene.step_s = period_s;
  scene.model.self_collision = true;
  scene::Obstacle ball;
  ball.name = "ball";
  ball.radius_m = 0.1;
  ball.pose = {Eigen::Matrix3d::Identity(), {0.15, 0.4, 0.0}};
  ball.motion = scene::LinearMotion{{0.05, 0.0, 0.0}, 0.0};
  scene.obstacles = {ball};
  return scene;
}

// From zero to q in one second.
scene::JointTrajectory trial_motion(const Eigen::VectorXd& q) {
  scene::JointTrajectory motion;
  motion.time_s = Eigen::Vector2d(0.0, 1.0);
  motion.q = motion.v = Eigen::MatrixXd::Zero(q.size(), 2);
  motion.q.col(1) = q;
  return motion;
}

}  // namespace

std::vector<TrialScene> built_in_scenes(const planning::Plugin& plugin) {
  model::ChainOptions chain;
  chain.links = 3;
  const model::Model arm(model::make_chain(chain), geometry::SE3{},
                         Eigen::Vector3d(0.0, 0.0, -9.81));
  const Eigen::Vector3d q(0.3, -0.2, 0.4);
  dynamics::Workspace ws(arm);
  dynamics::forward_kinematics(arm, ws, q);
  const geometry::SE3 tip = dynamics::tip_pose(arm, ws);
  std::vector<TrialScene> scenes;
  for (const auto& [name, goal] : {std::pair("a joint goal", scene::joint_goal(q)),
                                   std::pair("a position goal", scene::position_goal(tip.p())),
                                   std::pair("a pose goal", scene::pose_goal(tip))})
    scenes.push_back({name, scene_beside_ball(goal), arm});
  if (plugin.follows_trajectories())
    scenes.push_back(
        {"a trajectory", scene_beside_ball(scene::trajectory_goal(trial_motion(q))), arm});
  if (!plugin.follows_targets()) return scenes;
  scene::Goal follow = scene::follow_goal();
  follow.pose = tip;
  follow.motion = scene::SineMotion{{0.05, 0.05, 0.0}, 0.5};
  scenes.push_back({"a target that moves", scene_beside_ball(follow), arm});
  return scenes;
}

TrialScene read_trial_scene(const std::filesystem::path& file) {
  scene::Scene scene = scene::read_scene(file);
  model::Model arm = control::load_model(scene);
  return {file.filename().string(), std::move(scene), std::move(arm)};
}

std::optional<std::string> refusal(const Error& error) {
  const std::string text = error.what(), mark = "cannot start: ";
  const std::size_t at = text.find(mark);
  if (error.code() != ErrorCode::plugin || at == std::string::npos) return std::nullopt;
  std::string reason = text.substr(at + mark.size());
  if (reason == "no reason given" || reason == "create returned no planner") return std::nullopt;
  return reason;
}

namespace {

void run_trial(Loop& loop, const planning::Plugin& plugin, const TrialScene& scene, int ticks,
               int threads_before, Trial& out) {
  out.deadline_s = loop.controller().deadline_s();
  for (long k = 0; k < ticks; ++k) {
    loop.change(k);
    if (!loop.tick(out, out.answers)) return;
    if (k % 16 == 0) out.threads = std::max(out.threads, thread_count() - threads_before);
  }
  if (!plugin.can_reset()) return;
  loop.controller().reset();
  loop.controller().set_goals(scene.scene.goals);
  loop.restart();
  for (long k = 0; k < 60; ++k)
    if (!loop.tick(out, out.answers_after_reset)) return;
}

}  // namespace

Trial try_planner(const planning::Plugin& plugin, const Json& params, const TrialScene& scene,
                  int ticks) {
  Trial out;
#ifdef HAMELIN_SANITIZED  // the thread sanitizer adds a thread of its own to the first one
  std::thread([] {}).join();
#endif
  const int threads = thread_count();
  try {
    Loop loop(plugin, params, scene);
    run_trial(loop, plugin, scene, ticks, threads, out);
  } catch (const Error& e) {
    const auto reason = refusal(e);
    if (!reason) throw;
    out.refusal = *reason;
  }
  // A thread may need a moment to disappear after it was joined.
  for (int i = 0; i < 100 && thread_count() > threads; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  out.threads_left = thread_count() - threads;
  return out;
}

}  // namespace hamelin::app

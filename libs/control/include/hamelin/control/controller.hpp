#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

#include "hamelin/control/goal_tracker.hpp"
#include "hamelin/control/planner_host.hpp"
#include "hamelin/control/state_estimator.hpp"
#include "hamelin/control/torque_limits.hpp"
#include "hamelin/control/world.hpp"
#include "hamelin/control/world_view.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::control {

/// Where a control loop is. running: towards a goal. reached: all goals met; the planner holds the
/// last one. stalled: by the scene's stall rule. gave_up: by the planner's own judgement. stopping:
/// the planner failed, and the arm is brought to rest.
enum class ControlState : std::int32_t { running, reached, stalled, gave_up, stopping };

/// The answer of a tick. References stay valid until the next tick.
struct Answer {
  ControlState state = ControlState::running;
  std::string_view cause;  ///< why it gave up or stops: one line, or empty
  const planning::CommandBuffers* channels = nullptr;  ///< the planner's; null if it failed
  /// Sum of all channels within the limits of torque and its rate [Nm or N], docs/theory.md (8.7).
  Eigen::VectorXd torque;
  bool saturated = false;  ///< whether a limit reduced it
  /// For arms that are controlled by position: joint positions and velocities one period ahead.
  Eigen::VectorXd q_next, v_next;
  std::size_t goal_index = 0;  ///< of the current goal; the number of goals after the last
  /// Number of the World's snapshot that the answer is for.
  std::uint64_t snapshot = 0;
};

/// What a Controller is made with.
struct ControllerOptions {
  std::size_t obstacles_max = 64;  ///< see World::Options
  bool prepare_maps = true;        ///< see World::Options
  /// Prove that the motion since the last tick was clear, see Certificate; certify() has it.
  bool certify = true;
  std::optional<double> period_s;  ///< time between two ticks; none: that of the scene
  bool torque = true;              ///< fill Answer::torque
  bool position = false;           ///< fill Answer::q_next and v_next
  /// Bounds of the motion that q_next and v_next describe [rad/s² and rad/s³, or m/s² and m/s³].
  double acceleration_max = 15.0, jerk_max = 5000.0;
  PlannerHost::LineSink log;  ///< receives the planner's messages; empty: none
};

/// The control loop of an arm: the world that it sees, its planner, goals and limits, without a
/// plant and without a clock. One thread calls tick(); it neither allocates nor locks. Any thread
/// may update world().
class Controller {
 public:
  using Options = ControllerOptions;

  /// A controller for a scene file: robot, map, obstacles, goals, limits, planner, control period.
  /// @param plugin_directories where the planner is searched for, in order
  /// @throws Error for bad input: files, goals that do not fit the robot, parameters, a planner
  /// that
  ///         is not found or refuses to start
  Controller(const std::filesystem::path& scene_file,
             const std::vector<std::filesystem::path>& plugin_directories, Options options = {});
  /// The same from parts that the caller has already.
  Controller(const scene::Scene& scene,
             const std::vector<std::filesystem::path>& plugin_directories, Options options = {});
  Controller(const scene::Scene& scene, const model::Model& arm, const planning::Plugin& plugin,
             Options options);
  /// @param arm the model of the scene's robot; the planner gets it with the scene's mass scale
  /// @param params of the planner, checked and with defaults
  Controller(const scene::Scene& scene, const model::Model& arm, const planning::Plugin& plugin,
             const Json& params, Options options);
  Controller(const Controller&) = delete;
  Controller& operator=(const Controller&) = delete;

  /// The surroundings; updates take effect at the next tick.
  [[nodiscard]] World& world() noexcept { return world_; }

  /// observe() and decide().
  /// @param time_s of the measurement; must increase from tick to tick
  /// @param q, v measured joint positions and velocities; dof numbers each. v is not used if the
  ///        scene lets the controller estimate velocities.
  const Answer& tick(double time_s, const Eigen::VectorXd& q, const Eigen::VectorXd& v);

  /// The first half of a tick: takes the newest snapshot, finds near obstacles, checks goals and
  /// stalls. answer().state is running, reached or stalled afterwards.
  void observe(double time_s, const Eigen::VectorXd& q, const Eigen::VectorXd& v);
  /// The second half: calls the planner for what observe() found, and forms the outputs.
  void decide();
  [[nodiscard]] const Answer& answer() const noexcept { return answer_; }

  /// The proof for the motion between the last two ticks; empty after the first one and without
  /// Options::certify.
  [[nodiscard]] const std::optional<Certificate::Verdict>& verdict() const noexcept {
    return verdict_;
  }
  /// Forgets goals that were reached, the last motion and limits' history, for a new start.
  void reset();

  /// What it sees. A caller may look() at and certify() the motion between ticks with it.
  [[nodiscard]] WorldView& view() noexcept { return view_; }
  /// The state that the last tick acted on: as measured, or as estimated.
  [[nodiscard]] const Eigen::VectorXd& q() const noexcept { return q_; }
  [[nodiscard]] const Eigen::VectorXd& v() const noexcept { return v_; }
  [[nodiscard]] const GoalTracker& goals() const noexcept { return goals_; }
  [[nodiscard]] const planning::Plugin& plugin() const noexcept { return planner_.plugin(); }
  /// Time between two ticks [s].
  [[nodiscard]] double period_s() const noexcept { return period_s_; }

 private:
  void measure(const Eigen::VectorXd& q, const Eigen::VectorXd& v);
  void form_torque();
  void form_position();
  void brake();
  /// Positions follow from the torque where the planner sets no velocity.
  [[nodiscard]] bool forms_torque() const noexcept { return options_.torque || options_.position; }

  scene::Scene scene_;
  Options options_;
  double period_s_;
  model::Model nominal_;  ///< the planner's model of the arm
  World world_;
  WorldView view_;
  PlannerHost planner_;
  GoalTracker goals_;
  std::optional<StateEstimator> estimator_;
  std::vector<Eigen::VectorXd> issued_;  ///< for the estimator: torques, or accelerations
  TorqueLimits limits_;
  ChannelSum sum_;
  dynamics::Workspace ws_;
  Answer answer_;
  std::optional<Certificate::Verdict> verdict_;

  long k_ = 0;
  double time_s_ = 0.0;
  Eigen::VectorXd q_, v_, rate_, command_rate_;
};

}  // namespace hamelin::control

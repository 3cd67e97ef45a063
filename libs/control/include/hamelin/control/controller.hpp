#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "hamelin/control/goal_list.hpp"
#include "hamelin/control/goal_tracker.hpp"
#include "hamelin/control/live_target.hpp"
#include "hamelin/control/newest.hpp"
#include "hamelin/control/planner_host.hpp"
#include "hamelin/control/shield.hpp"
#include "hamelin/control/state_estimator.hpp"
#include "hamelin/control/torque_limits.hpp"
#include "hamelin/control/torque_pipeline.hpp"
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
  /// Whether the shield refused the planner's answer, and torque or position are those of its stop.
  bool stopping = false;
  /// For arms that are controlled by position: joint positions and velocities one period ahead.
  Eigen::VectorXd q_next, v_next;
  /// Number of the list of goals: 0 for the scene's, else what set_goals() returned.
  std::uint64_t goals_number = 0;
  std::size_t goal_index = 0;  ///< of the current goal in it; the number of goals after the last
  /// The target of the current goal, where that is a follow goal; else null.
  const TargetState* target = nullptr;
  /// Number of the World's snapshot that the answer is for.
  std::uint64_t snapshot = 0;
  /// The planner's own figures, see Controller::series(); NaN where it set none.
  std::span<const double> series;
  /// Time that the planner took by Options::clock_s [s], and in how many ticks since the start it
  /// took longer than the deadline; 0 without a clock.
  double planner_s = 0.0;
  std::uint64_t overruns = 0;
};

/// Seconds of the computer's steady clock.
[[nodiscard]] double steady_clock_s();

/// What a Controller is made with.
struct ControllerOptions {
  std::size_t obstacles_max = 64;     ///< see World::Options
  bool prepare_maps = true;           ///< see World::Options
  ObservationOptions observations{};  ///< see World::Options
  /// Prove that the motion since the last tick was clear, see Certificate; certify() has it.
  bool certify = true;
  std::optional<double> period_s;  ///< time between two ticks; none: that of the scene
  bool torque = true;              ///< fill Answer::torque
  bool position = false;           ///< fill Answer::q_next and v_next, and Answer::torque
  /// Bounds of the motion that q_next and v_next describe [rad/s² and rad/s³, or m/s² and m/s³]:
  /// one value, or one per joint.
  std::vector<double> acceleration_max{15.0}, jerk_max{5000.0};
  /// The largest number of way-points of a goal's path, also of goals that are set later; none:
  /// that of the scene's goals, at least 256.
  std::optional<std::size_t> path_points_max;
  /// Returns seconds, for measuring how long the planner takes: steady_clock_s(), or a clock of the
  /// caller; null: no clock is read.
  double (*clock_s)() = nullptr;
  /// The planner has failed after so many answers in a row beyond the deadline; 0: never. Single
  /// late answers are used. Without a clock none is late.
  int late_answers_max = 10;
  /// Receives the planner's messages on the thread that calls the planner; empty: none.
  PlannerHost::LineSink log;
  /// Tell `log` of the first tick in which the planner exceeded its deadline. The line contains
  /// measured time, so it differs from run to run.
  bool log_overrun = true;
};

/// The control loop of an arm: the world that it sees, its planner, goals and limits, without a
/// plant. Time comes from the caller, also the clock by which the planner is late. One
/// thread calls tick(); it neither allocates nor locks, unless the planner declares that it does.
/// Any thread may update world(), goals and the planner's parameters.
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

  /// Replaces the goals, from the next tick on. Any thread.
  /// @param goals in the order in which they must be reached; scene::joint_goal() and the like have
  ///        default tolerances
  /// @return the number of the list, see Answer::goals_number
  /// @throws Error invalid for goals that do not fit the arm, a path longer than
  ///         Options::path_points_max, or no goal; nothing changes then
  std::uint64_t set_goals(std::vector<scene::Goal> goals);
  std::uint64_t set_goal(scene::Goal goal) { return set_goals({std::move(goal)}); }

  /// Moves the target of the follow goal, from the next tick on: a pose, from where it goes on with
  /// the velocities that are given or else estimated, or a twist, as of a joystick. Any thread; the
  /// tick takes the newest without a lock. Times must increase. The bounds are those of the goal,
  /// scene::TargetStream.
  /// @throws Error invalid, "target: …", if no goal follows a streamed target, for numbers that are
  ///         not finite, times that do not increase, and poses that jump; nothing changes then
  void set_target(const TargetPose& pose);
  void set_target(const TargetTwist& twist);

  /// Changes parameters of the planner, from the next tick on. Any thread.
  /// @param changes an object with those that change; the others stay
  /// @throws Error invalid for values that the planner's schema or the planner refuses, also if it
  ///         cannot change parameters while it runs; nothing changes then
  void set_planner_params(const Json& changes);
  /// All parameters of the planner, as last set.
  [[nodiscard]] Json planner_params() const;

  /// observe() and decide().
  /// @param time_s of the measurement; must increase from tick to tick
  /// @param q, v measured joint positions and velocities; dof numbers each. v is not used if the
  ///        scene lets the controller estimate velocities. If they are not finite, the arm is
  ///        brought to rest.
  /// @throws Error invalid if those of the first tick are not finite
  const Answer& tick(double time_s, const Eigen::VectorXd& q, const Eigen::VectorXd& v);

  /// The first half of a tick: takes the newest snapshot, finds near obstacles, checks goals and
  /// stalls. answer().state is running, reached or stalled afterwards.
  void observe(double time_s, const Eigen::VectorXd& q, const Eigen::VectorXd& v);
  /// The second half: calls the planner for what observe() found, and forms the outputs.
  /// @throws Error invalid at the first tick if the shield finds no way to stop there
  void decide();
  [[nodiscard]] const Answer& answer() const noexcept { return answer_; }

  /// The proof for the motion between the last two ticks; empty after the first one and without
  /// Options::certify.
  [[nodiscard]] const std::optional<Certificate::Verdict>& verdict() const noexcept {
    return verdict_;
  }
  /// Forgets goals that were reached, the last motion and limits' history, for a new start; so does
  /// the planner at the next tick, if it can. For the thread of tick().
  void reset();

  /// The scene's shield; null if it asks for none.
  [[nodiscard]] Shield* shield() noexcept { return shield_.get(); }
  /// What the shield keeps the arm from, at the last tick.
  [[nodiscard]] Shield::Surroundings surroundings() const noexcept {
    return {view_.environment(), view_.snapshot(), time_s_};
  }

  /// What it sees. A caller may look() at and certify() the motion between ticks with it.
  [[nodiscard]] WorldView& view() noexcept { return view_; }
  /// The state that the last tick acted on: as measured, or as estimated.
  [[nodiscard]] const Eigen::VectorXd& q() const noexcept { return q_; }
  [[nodiscard]] const Eigen::VectorXd& v() const noexcept { return v_; }
  [[nodiscard]] const GoalTracker& goals() const noexcept { return goals_; }
  [[nodiscard]] const planning::Plugin& plugin() const noexcept { return planner_.plugin(); }
  /// The numeric series that the planner declared, in the order of Answer::series.
  [[nodiscard]] const std::vector<planning::Series>& series() const noexcept {
    return planner_.series();
  }
  /// Pose of the tip at the last tick, in the world.
  [[nodiscard]] geometry::SE3 tip() const { return dynamics::tip_pose(nominal_, view_.poses()); }
  /// Time between two ticks [s].
  [[nodiscard]] double period_s() const noexcept { return period_s_; }
  /// Time that the planner should not exceed in a tick [s], see Answer::overruns.
  [[nodiscard]] double deadline_s() const noexcept { return deadline_s_; }

 private:
  /// The planner's parameters on their way to the tick.
  struct NewParams {
    std::uint64_t number = 0;
    std::optional<planning::PreparedParams> params;
  };
  [[nodiscard]] std::unique_ptr<Shield> make_shield();
  [[nodiscard]] planning::SetupData make_setup();
  void measure(const Eigen::VectorXd& q, const Eigen::VectorXd& v);
  void take_braking_state();
  void start_outputs();
  void take_goals();
  /// Notes whether these goals follow a streamed target.
  void expect_target(const std::vector<scene::Goal>& goals);
  template <class Sample>
  void receive_target(const Sample& sample);
  void update_target();
  /// The current goal as the planner sees it.
  [[nodiscard]] const hamelin_goal* goal_for_planner();
  void take_params();
  /// Calls the planner. @return whether it has not failed; else failure_ says why
  [[nodiscard]] bool ask_planner();
  [[nodiscard]] bool in_time(double planner_s);
  void log_first_overrun();
  [[nodiscard]] double braking_time_s() const;
  void start_braking(std::string_view cause);
  void form_torque();
  void form_position();
  /// Replaces an output that the shield refuses by that of its stop.
  void shield_torque();
  void shield_position();
  void brake();
  /// Positions follow from the torque where the planner sets no velocity.
  [[nodiscard]] bool forms_torque() const noexcept { return options_.torque || options_.position; }

  scene::Scene scene_;
  Options options_;
  double period_s_, deadline_s_;
  std::size_t path_points_max_;
  model::Model nominal_;                         ///< the planner's model of the arm
  Eigen::VectorXd acceleration_max_, jerk_max_;  ///< of each joint, of positions
  World world_;
  WorldView view_;
  std::unique_ptr<Shield> shield_;
  bool shielded_ = false;  ///< whether the shield has started
  PlannerHost planner_;
  // Each is among writers; the tick takes none.
  std::mutex goals_mutex_;
  mutable std::mutex params_mutex_;
  std::uint64_t goals_number_ = 0, params_number_ = 0;  ///< of the newest, for writers
  Json params_;
  Newest<GoalList> new_goals_;
  Newest<NewParams> new_params_;
  const GoalList* goal_list_;  ///< that the tick uses
  TargetReceiver receiver_;    ///< among writers, as goals_mutex_
  bool receives_ = false;      ///< whether the newest goals follow a streamed target
  Newest<StreamedTarget> new_target_;
  LiveTarget target_;
  const hamelin_goal* listed_ = nullptr;  ///< the goal of the last tick in its list
  hamelin_goal live_goal_{};              ///< the current one if it is a follow goal
  std::uint64_t used_params_ = 0;
  PlannerGoal goal_{};
  GoalTracker goals_;
  std::optional<StateEstimator> estimator_;
  std::vector<Eigen::VectorXd> issued_;  ///< for the estimator: torques, or accelerations
  TorqueLimits limits_;
  ChannelSum sum_;
  dynamics::Workspace ws_;
  std::optional<TorquePipeline> pipeline_;  ///< with a shield, where torques are the output
  /// What the shield starts from: where friction is not known, an estimate lags behind.
  Eigen::VectorXd q_measured_;
  Eigen::VectorXd point_q_, point_v_;  ///< set point of the last tick
  Answer answer_;
  std::optional<Certificate::Verdict> verdict_;

  long k_ = 0;
  bool measured_ = true;  ///< whether the last measurement is finite
  std::string_view failure_;
  int late_answers_ = 0;             ///< in a row
  std::array<char, 192> late_line_;  ///< memory of failure_ where answers were late
  bool reset_ = false;               ///< whether the planner is to be told of a new start
  double time_s_ = 0.0;
  Eigen::VectorXd q_, v_, rate_, command_rate_;
  Eigen::VectorXd brake_q_, brake_v_, brake_rate_;  ///< of the motion that ends at rest
};

}  // namespace hamelin::control

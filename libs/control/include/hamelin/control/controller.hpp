#pragma once
#include <Eigen/Core>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/control/answer.hpp"
#include "hamelin/control/goal_tracker.hpp"
#include "hamelin/control/line_buffer.hpp"
#include "hamelin/control/live_reference.hpp"
#include "hamelin/control/live_target.hpp"
#include "hamelin/control/world.hpp"
#include "hamelin/control/world_view.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::control {

class DiscreteArm;
class Guidance;
class PathReference;
struct CertifiedPath;
class Shield;
class Stop;
struct GoalList;
struct ArmSetup;
struct DriveOptions;
struct LoadedArm;
struct Mailbox;
struct NewLoad;

/// Seconds of the computer's steady clock.
[[nodiscard]] double steady_clock_s();

/// What a Controller is made with.
struct ControllerOptions {
  std::size_t obstacles_max = 64;     ///< see World::Options
  bool prepare_maps = true;           ///< see World::Options
  ObservationOptions observations{};  ///< see World::Options
  /// Prove that the motion since the last tick was clear, see Certificate; certify() has it.
  bool certify = true;
  /// Time between two ticks [s], at most 1; none: that of the scene.
  std::optional<double> period_s;
  bool position = false;  ///< fill Answer::q_next and v_next besides Answer::torque
  /// For simulations: makes this arm take the discrete step that the answer means, in place of
  /// sending a torque. Kept by reference; null: none.
  DiscreteArm* ideal_arm = nullptr;
  /// Bounds of the motion that q_next and v_next describe [rad/s² and rad/s³, or m/s² and m/s³]:
  /// one value, or one per joint.
  std::vector<double> acceleration_max{15.0}, jerk_max{5000.0};
  /// By how much an arm that is controlled by position may be away from its set point [rad or m],
  /// one value, or one per joint: farther away it is held up, and its set point is brought to rest.
  std::vector<double> tracking_max{0.1};
  /// The largest number of way-points of a goal's path, also of goals that are set later; none:
  /// that of the scene's goals, at least 256.
  std::optional<std::size_t> path_points_max;
  /// Returns seconds, for measuring how long the planner takes: steady_clock_s(), or a clock of the
  /// caller; null: no clock is read.
  double (*clock_s)() = nullptr;
  /// The planner has failed after so many answers in a row beyond the deadline; 0: never. Single
  /// late answers are used. Without a clock none is late.
  int late_answers_max = 10;
  /// For so many ticks in a row the arm may be without a measurement that can be used: it is then
  /// where its model takes it. After more of them it is stopped.
  int lost_measurements_max = 0;
  /// How far payloads that are attached later extend beyond the tip [m], and how many shapes they
  /// have together; none: as the scene's events say. What the arm can reach is known so much
  /// farther.
  std::optional<double> payload_reach_m;
  std::optional<std::size_t> payload_shapes_max;
  /// Whether a scene's guide searches on a thread of its own, at no charge. Else the caller calls
  /// run_guide(), and each check of a search delays the path by the scene's check_time_s.
  bool guide_thread = true;
  /// Receives the planner's messages on the thread that calls the planner; empty: none.
  LineSink log;
  /// Tell `log` of the first tick in which the planner exceeded its deadline. The line contains
  /// measured time, so it differs from run to run.
  bool log_overrun = true;
  /// Nothing will be added to the world, so that a scene in which the arm can hit or pass nothing
  /// needs no shield. Else a controller has a shield unless its scene refuses one (safety.type).
  bool fixed_world = false;
};

/// The control loop of an arm: the world that it sees, its planner, goals and limits, without a
/// plant. Time comes from the caller, also the clock by which the planner is late. One
/// thread calls tick(); it neither allocates nor locks, unless the planner declares that it does.
/// Any thread may update world(), goals and the planner's parameters.
class Controller {
 public:
  using Options = ControllerOptions;

  /// A controller for a scene file: robot, map, obstacles, goals, limits, planner, control period.
  /// The outputs that are asked for decide which bounds of safety hold, not the actuation that the
  /// scene was written for: torques are sent sampled, and positions to servos.
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
  ~Controller();
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

  /// Fixes a body to the tip, from the next tick on: its mass joins the model of the arm, its
  /// shapes those of the arm, except that parts that it touches at q may go on to touch it. The
  /// planner is made again for the arm as it is then, and forgets what it learnt on the way. The
  /// tick refuses the payload if its shapes are in contact, or a shield finds no way to stop with
  /// it: then the arm goes on without it, see Answer::load_refusal. Any thread; this takes
  /// milliseconds.
  /// @param q configuration in which it is attached; dof numbers
  /// @return the number of what the arm carries then, see Answer::load
  /// @throws Error invalid for a payload that check() refuses, of a name that is in use, or that
  ///         exceeds Options::payload_reach_m or payload_shapes_max; nothing changes then
  std::uint64_t attach(const scene::Payload& payload, const Eigen::VectorXd& q);
  /// Takes it off again, from the next tick on. Any thread; this takes milliseconds.
  /// @throws Error invalid if nothing of this name is attached
  std::uint64_t detach(std::string_view name, const Eigen::VectorXd& q);
  /// The names of what is attached, or will be at the next tick. Any thread.
  [[nodiscard]] std::vector<std::string> attached() const;

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
  /// @param time_s of the measurement; must not fall from tick to tick. If it falls, or is not
  ///        finite, the arm is brought to rest.
  /// @param q, v measured joint positions and velocities; dof numbers each. v is not used if the
  ///        scene lets the controller estimate velocities. If one of them is not finite or beyond
  ///        1e6, the arm is brought to rest.
  /// @throws Error invalid for arrays of another size, or if the time, q or v of the first tick
  ///         cannot be used
  const Answer& tick(double time_s, const Eigen::VectorXd& q, const Eigen::VectorXd& v);

  /// The same for a tick at which no measurement came, a period after the last one.
  /// @throws Error usage at the first tick
  const Answer& tick_unseen();

  /// The first half of a tick: takes the newest snapshot, finds near obstacles, checks goals and
  /// stalls. answer().state is running, reached or stalled afterwards.
  void observe(double time_s, const Eigen::VectorXd& q, const Eigen::VectorXd& v);
  /// The second half: calls the planner for what observe() found, and forms the outputs.
  /// @throws Error invalid at the first tick if the shield finds no way to stop there
  void decide();
  [[nodiscard]] const Answer& answer() const noexcept { return answer_; }

  /// Brings the arm to rest from the next tick on, and holds it. Any thread.
  /// @param cause for Answer::cause, as one line, which has its first LineBuffer::size_max bytes
  void stop(std::string_view cause);
  /// Goes on from where the arm is measured to be, from the next tick on, if the last answer has
  /// the state `stopping` and its cause is gone; servos that still move go on from their set point.
  /// Planner, guide and shield are made again, goals go on where they were. If the measurement of
  /// that tick cannot be used, the next one that can is waited for, unless more than
  /// Options::lost_measurements_max are lost in a row. The arm remains stopped then, and if there
  /// is no way to stop from where it is, which Answer::cause says. A stop that no answer has shown
  /// yet remains. Any thread; this takes milliseconds.
  /// @throws Error plugin if the planner refuses to start; nothing changes then
  void resume();

  /// Searches the path that the last tick has asked for, if it did, without Options::guide_thread.
  /// For the thread of tick(); this allocates.
  void run_guide();
  /// What the scene's guide did; null if it has none.
  [[nodiscard]] const GuideFigures* guide_figures() const noexcept;
  /// Why the arm waits for a path that its guide has not found; empty: it does not.
  [[nodiscard]] std::string_view guide_cause() const noexcept;

  /// The proof for the motion between the last two ticks; empty after the first one and without
  /// Options::certify.
  [[nodiscard]] const std::optional<Certificate::Verdict>& verdict() const noexcept {
    return verdict_;
  }
  /// A new start, for instance after the arm was guided by hand: the next ticks are those of a
  /// controller that was just made, with the goals, the parameters, the load and the world that are
  /// in force. A planner that cannot be told of a new start is made again. For the thread of
  /// tick(), between two ticks; this takes milliseconds.
  /// @throws Error plugin if the planner refuses to start again; do not call tick() then
  void reset();

  /// What the shield did; none if the scene refuses one, or needs none, see Options::fixed_world.
  /// For the thread of tick().
  [[nodiscard]] std::optional<ShieldReport> shield_report() const;
  /// Describes what was in the way of the last step that the shield refused, at the end of a line,
  /// without allocating; nothing if it refused none.
  void describe_refusal(LineBuffer& line) const;
  /// The shield itself, for tests; null if there is none. Another object after reset() and whenever
  /// the load changes.
  [[nodiscard]] Shield* shield() noexcept;
  [[nodiscard]] const Shield* shield() const noexcept;
  /// What the shield keeps the arm from, at the last tick.
  [[nodiscard]] Surroundings surroundings() const noexcept;

  /// What it sees, until the load changes. A caller may look() at and certify() the motion between
  /// ticks with it.
  [[nodiscard]] WorldView& view() noexcept;
  [[nodiscard]] const WorldView& view() const noexcept;
  /// The controller's model of the arm with what it carries, until the load changes.
  [[nodiscard]] const model::Model& model() const noexcept;
  /// The state that the last tick acted on: as measured, or as estimated.
  [[nodiscard]] const Eigen::VectorXd& q() const noexcept;
  [[nodiscard]] const Eigen::VectorXd& v() const noexcept;
  [[nodiscard]] const GoalTracker& goals() const noexcept { return goals_; }
  [[nodiscard]] const planning::Plugin& plugin() const noexcept { return plugin_; }
  /// The numeric series that the planner declared, in the order of Answer::series.
  [[nodiscard]] const std::vector<planning::Series>& series() const noexcept;
  /// The lines that the planner drew last.
  [[nodiscard]] const Drawing& drawing() const noexcept;
  /// Pose of the tip at the last tick, in the world. @throws Error before the first tick
  [[nodiscard]] geometry::SE3 tip() const;
  /// Time between two ticks [s].
  [[nodiscard]] double period_s() const noexcept { return period_s_; }
  /// Time that the planner should not exceed in a tick [s], see Answer::overruns.
  [[nodiscard]] double deadline_s() const noexcept { return deadline_s_; }

 private:
  [[nodiscard]] ArmSetup arm_setup() noexcept;
  /// Publishes an arm with other payloads. The caller has locked load_mutex_.
  std::uint64_t publish_load(std::vector<scene::Payload> payloads, const Eigen::VectorXd& q);
  /// Makes an arm of these payloads, and hands it to the tick. The caller has locked load_mutex_.
  void publish_arm(std::uint64_t number, std::uint64_t resumes, model::Model model,
                   const Eigen::VectorXd& q);
  [[nodiscard]] model::Model model_carrying(std::span<const scene::Payload> payloads,
                                            const Eigen::VectorXd& q) const;
  /// What is attached, or will be if the tick does not refuse it, and its number. The caller has
  /// locked load_mutex_.
  struct Carried {
    std::uint64_t number;
    const std::vector<scene::Payload>& payloads;
  };
  [[nodiscard]] Carried newest_load() const;
  void take_load();
  void refuse_to_go_on(const LineBuffer& defect);
  void refuse_load(std::uint64_t number, const LineBuffer& defect);
  /// Ends the stop.
  void go_on();
  void take_stop();
  /// Writes why the arm cannot begin with the load where it is; nothing if it can.
  void describe_defect(LoadedArm& fresh, LineBuffer& line);
  void measure(double time_s, const Eigen::VectorXd& q, const Eigen::VectorXd& v);
  /// The rest of observe(), once the measurement is taken or missing.
  void look(bool first);
  void see();
  /// Notes why the measurement cannot be used. @throws Error invalid at the first tick
  void lose_measurement(double time_s, bool in_order);
  /// Stops an arm that cannot be seen, or does not do what it is sent.
  void check_arm();
  [[nodiscard]] std::unique_ptr<GoalList> first_goals();
  void make_guidance();
  void take_goals();
  using ProvedMotions = std::vector<std::shared_ptr<const CertifiedPath>>;
  /// Keeps the motions of goals, and forgets those that the tick has released. The caller has
  /// locked load_mutex_.
  void keep_motions(std::uint64_t number, const ProvedMotions& motions);
  /// Releases the motions of earlier goals, unless a stop or its proof is still along one of them.
  void release_motions();
  /// Notes whether these goals follow a streamed target.
  void expect_target(const std::vector<scene::Goal>& goals);
  template <class Sample>
  void receive_target(const Sample& sample);
  void allow_for_goal();
  void update_target();
  void update_reference();
  /// The current goal as the planner sees it.
  [[nodiscard]] const hamelin_goal* goal_for_planner();
  void take_params();
  /// Lets the guide choose what the planner is shown.
  void update_guidance();
  /// Moves on along a path; null: there is none.
  void follow(const CertifiedPath* path);
  /// Follows the path that the guide has found, if the goal has none, and tells the shield of it.
  void update_path();
  /// That of the current goal; null if it has none, or the arm could not stay on it.
  [[nodiscard]] const CertifiedPath* proved_trajectory() const noexcept;
  /// Whether the arm is on the trajectory of its goal, and not at its end.
  [[nodiscard]] bool on_the_way() const noexcept;
  /// The path along which the stop in force goes; else null.
  [[nodiscard]] const CertifiedPath* path_in_force() const noexcept;
  /// Calls the planner; stops the arm if it fails or was late too often.
  void ask_planner();
  void note_time(double planner_s);
  void log_first_overrun();
  void start_braking(StopReason reason, std::string_view cause);
  /// Lets the drive make a proposal of the planner's answer.
  void propose();
  /// Lets the proposal act, or a stop.
  void act();

  Options options_;
  scene::Scene scene_;  ///< with the actuation and the safety that are in force
  double period_s_, deadline_s_;
  std::size_t path_points_max_;
  planning::Plugin plugin_;
  model::Model nominal_;  ///< the planner's model of the arm, without what is attached later
  std::unique_ptr<DriveOptions> drive_options_;
  World world_;
  Json params_;                      ///< of the planner, as last set
  std::atomic<double> time_s_{0.0};  ///< of the last tick
  std::unique_ptr<LoadedArm> arm_;   ///< that the tick uses
  bool shielded_ = false;            ///< whether the shield has started
  // Each is among writers; the tick takes none.
  mutable std::mutex goals_mutex_, load_mutex_;
  std::uint64_t goals_number_ = 0, params_number_ = 0, load_number_ = 0;  ///< of the newest
  std::vector<scene::Goal> newest_goals_;
  std::vector<std::pair<std::uint64_t, ProvedMotions>> kept_motions_;  ///< by number of the goals
  std::atomic<std::uint64_t> oldest_goals_{0};  ///< whose motions the tick may still use
  LoadedArm* newest_arm_;  ///< for writers: the last that was published, or the first
  std::vector<scene::Payload> attached_, accepted_;  ///< with the newest load, and one in use
  std::atomic<std::uint64_t> refused_load_{0}, used_load_{0};
  std::uint64_t serial_ = 0, resumes_ = 0;  ///< of the newest NewLoad
  std::atomic<std::uint64_t> taken_serial_{0};
  /// Of a resumption that waits for a measurement, and of one that a stop has ended before it came.
  std::uint64_t waiting_serial_ = 0, withdrawn_serial_ = 0;
  std::mutex stop_mutex_;
  std::uint64_t stop_number_ = 0, taken_stop_ = 0;
  /// How often the arm was stopped, and at which of the stops it stands still; 0: it does not.
  std::uint64_t stops_ = 0;
  std::uint64_t begun_stop_ = 0;  ///< the last one that began without a shield
  std::atomic<std::uint64_t> stopped_{0};
  std::vector<std::atomic<double>> measured_;  ///< the last joint positions, for other threads
  std::unique_ptr<Mailbox> mail_;
  const GoalList* goal_list_;  ///< that the tick uses
  TargetReceiver receiver_;    ///< among writers, as goals_mutex_
  bool receives_ = false;      ///< whether the newest goals follow a streamed target
  LiveTarget target_;
  LiveReference reference_;
  std::unique_ptr<PathReference> path_reference_;
  const CertifiedPath* forsaken_ = nullptr;  ///< a trajectory on which the arm could not stay
  bool on_path_ = false;  ///< whether the arm was near the reference of a certified path
  double held_s_ = 0.0;   ///< for which the arm was not allowed to leave its place on the path
  const hamelin_goal* listed_ = nullptr;  ///< the goal of the last tick in its list
  hamelin_goal live_goal_{};              ///< the current one if it changes from tick to tick
  std::uint64_t used_params_ = 0;
  PlannerGoal goal_{};
  std::unique_ptr<Guidance> guidance_;  ///< null without a guide
  std::uint64_t guidance_number_ = 0, listed_number_ = 0;
  LineBuffer guide_line_;  ///< that was logged last
  GoalTracker goals_;
  bool usable_ = false;   ///< whether the measurement of this tick can be used
  int unusable_ = 0;      ///< so many in a row cannot be used
  double given_s_ = 0.0;  ///< the last time that was in order
  Answer answer_;
  std::optional<Certificate::Verdict> verdict_;

  long k_ = 0;
  std::string_view lost_;  ///< why the last measurement cannot be used; empty if it can
  int late_answers_ = 0;   ///< in a row
  /// Memory of lost_, of answer_.cause while the arm stops, and of answer_.load_refusal.
  LineBuffer lost_line_, cause_line_, load_refusal_;
  bool reset_ = false;  ///< whether the planner is to be told of a new start
};

}  // namespace hamelin::control

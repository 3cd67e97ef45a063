#pragma once
#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "actuation.hpp"
#include "energy_audit.hpp"
#include "hamelin/control/controller.hpp"
#include "hamelin/control/planner_setup.hpp"
#include "hamelin/geometry/se3.hpp"
#include "hamelin/simulation/run.hpp"
#include "judge.hpp"
#include "recorder.hpp"
#include "sensor_feed.hpp"
#include "target_feed.hpp"
#include "tick_log.hpp"
#include "tracking_audit.hpp"
#include "trajectory_audit.hpp"
#include "wrench_feed.hpp"

namespace hamelin::simulation {

/// A scene that is ready to run: the controller, the plant, the actuation that carries out
/// the controller's answers, and a judge who sees all obstacles and watches every step. It also
/// plays the sensor that shows the controller obstacles and changes of the map. One object per run.
class ClosedLoop {
 public:
  /// @throws Error for bad input: robot, map, planner parameters, goals that do not fit the robot
  ClosedLoop(const scene::Scene& scene,
             const std::vector<std::filesystem::path>& plugin_directories,
             const PlantFactory& plant_factory);
  /// @throws Error invalid if the start is beyond a limit in force, see scene::start_defect(). The
  /// replay of a log does not call this: it repeats what an earlier version ran.
  void check_start() const;
  [[nodiscard]] log::Result run(const Watch& watch);

 private:
  /// Logs a message of the planner.
  void log_planner_message(std::int32_t level, std::string_view line);
  /// Reports an event to the log and to diagnostics.
  void report_event(bool warning, const std::string& text);
  [[nodiscard]] bool has_diagnostics(int level) const;
  /// Makes the plant, at the scene's start, and the actuation that drives it.
  void make_plant(const PlantFactory& factory);
  [[nodiscard]] control::Controller::Options controller_options();
  void start(const Watch& watch);
  /// Opens the stream of targets, if a goal follows one.
  void open_target_feed(const Watch& watch);

  /// Observes the node that the last step reached: velocity, surroundings, proof that the step
  /// stayed clear, and changes of the map that are due.
  void observe_node();
  /// Logs the voxels that a camera was the first to find occupied, as runs along x.
  void record_seen(const std::string& camera, const std::vector<scene::VoxelBox>& runs);
  /// Shows the controller obstacles that come into sight.
  void reveal_obstacles();
  void change_map();

  // Of the scene's events, in load_events.cpp.
  /// Begins events that are due, and completes one that the controller has carried out.
  void advance_events();
  [[nodiscard]] bool is_due(const scene::Event& event) const;
  void begin(const scene::Event& event);
  /// What the controller has accepted becomes true of the arm, the map and the judge.
  /// @param accepted whether it has accepted another load
  void complete(const scene::Event& event, bool accepted);
  /// Index of the obstacle that the next event attaches or detaches; none: what it does is none.
  [[nodiscard]] std::optional<std::size_t> carried_obstacle() const;
  /// Where it is, or was when it was attached.
  [[nodiscard]] geometry::SE3 obstacle_pose(std::size_t index) const;
  [[nodiscard]] scene::Obstacle obstacle_at(std::size_t index, const geometry::SE3& pose) const;
  /// Pose of the tip at this node.
  [[nodiscard]] geometry::SE3 tip() const;
  /// Tells the controller that an obstacle is not there any more, or is there again.
  void begin_obstacle(std::size_t index, bool is_attached);
  /// That becomes true, or the controller is told that it does not.
  void complete_obstacle(std::size_t index, bool is_attached, bool accepted);
  /// The arm carries what `carried_` lists from this node on.
  void take_load();
  /// Logs that something of this name is "attached" or "detached".
  void record_load(const std::string& name, const char* what);
  /// The controller has refused to carry what an event attaches.
  void note_refused_load(const scene::Event& event);
  /// Ends the run at this node if an outcome applies.
  void check_outcome();
  /// Says as well what a shield holds the arm for.
  [[nodiscard]] std::string timeout_cause() const;
  /// Whether the shield's stop has brought the arm to rest.
  [[nodiscard]] bool rests() const;
  /// Whether the arm itself is at the last goal, when its set point is.
  [[nodiscard]] bool arrived() const;
  /// Of the arm itself, at the current goal or the last one.
  [[nodiscard]] control::GoalError goal_error() const;
  /// Why an arm within the tolerances of its goal has not reached it; empty if it is away from it.
  [[nodiscard]] std::string why_not_there() const;
  /// Lets the controller look at the arm, as it measures it, and at its goals.
  void let_controller_observe();
  /// Passes on the targets that are due.
  void feed_target();
  void note_reference();
  void note_tracking();
  /// Ends the run where the target has come to its end, or is lost in a scene that ends then.
  void check_target();
  void ask_planner();
  /// Ends the run if the controller's planner failed, at rest if a shield can stop the arm.
  /// @return whether it did not
  bool planner_answered();
  /// Ends the run now, or once the shield has brought the arm to rest.
  void finish_at_rest(log::Outcome outcome, std::string cause);
  /// Logs where a stop of the shield begins, unless it follows another one at once.
  void report_stop();
  void let_answer_act();
  /// The same, and checks the accounts.
  void apply_answer();
  /// Books the last node: nothing acts any more, but its energies belong to the account.
  void book_last_node();
  /// Books the last node with the answer that was made for it, if there is one.
  void book_answer();
  void write_tick();
  /// Lets the wrenches act that are due at this node.
  void push_arm();
  void step();

  void finish(log::Outcome outcome, std::string cause);
  void finish_if(std::string defect);
  void fill_result();

  const scene::Scene& scene_;
  model::Model model_;
  control::ModelledLimits limits_;
  long steps_ = 0;
  std::unique_ptr<Plant> plant_;
  control::DiscreteArm* ideal_arm_ = nullptr;  ///< the plant's, under ideal actuation
  Json planner_params_;
  std::vector<log::Input> inputs_;
  log::Result result_;
  std::unique_ptr<control::Controller> controller_;
  std::unique_ptr<Judge> judge_;
  std::unique_ptr<SensorFeed> sensors_;   ///< null if the scene has none
  std::unique_ptr<WrenchFeed> wrenches_;  ///< as `sensors_`
  std::unique_ptr<Actuation> actuation_;
  Eigen::VectorXd q_shown_, v_shown_;  ///< to the controller

  // State of the run.
  std::unique_ptr<Recorder> recorder_;
  std::unique_ptr<EnergyAudit> audit_;
  std::unique_ptr<TickLog> log_;
  std::unique_ptr<TargetFeed> feed_;         ///< only of a streamed target
  std::unique_ptr<TrackingAudit> tracking_;  ///< only with a follow goal
  TrajectoryAudit trajectory_;
  bool target_lost_ = false;         ///< at the last tick
  std::optional<double> ends_by_s_;  ///< once the target is lost in a scene that ends then
  const Watch* watch_ = nullptr;
  struct Message {
    bool warning;
    std::string text;
  };
  std::vector<Message> early_messages_;  ///< of the planner, before the log was open
  bool done_ = false;
  double stopped_at_s_ = -1.0;  ///< beginning of the shield's last stop
  bool halting_ = false;        ///< whether the run ends when the shield's stop does
  long saturated_steps_ = 0;
  std::size_t next_map_change_ = 0, goals_reached_ = 0, next_event_ = 0;
  model::Model bare_;                            ///< the arm without what events attach to it
  std::vector<scene::Payload> carried_;          ///< attached by events
  std::map<std::size_t, geometry::SE3> in_tip_;  ///< poses of obstacles that were attached
  std::uint64_t expected_load_ = 0;              ///< of the event that has begun; 0: none has
  long observed_k_ = -1;                         ///< the step at which the controller last looked
  double observing_s_ = 0.0;                     ///< that this took
};

}  // namespace hamelin::simulation

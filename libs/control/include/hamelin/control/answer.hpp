#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "hamelin/control/live_reference.hpp"
#include "hamelin/control/live_target.hpp"
#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::control {

/// Where a control loop is. running: towards a goal. reached: all goals met; the planner holds the
/// last one. stalled: by the scene's stall rule. gave_up: by the planner's own judgement. stopping:
/// the planner failed, a measurement or its time cannot be used, the arm does not follow its set
/// point, or stop() was called: the arm is brought to rest and held until resume() or reset().
enum class ControlState : std::int32_t { running, reached, stalled, gave_up, stopping };

/// What an arm is stopped for. planner: it failed, or its sum of channels is no number. late: too
/// many answers in a row were. measurement: it or its time cannot be used. tracking: the arm is
/// away from its set point. request: stop().
enum class StopReason : std::int32_t { none, planner, late, measurement, tracking, request };

/// The answer of a tick; its torques, positions and velocities are always finite. References stay
/// valid until the next tick.
struct Answer {
  ControlState state = ControlState::running;
  StopReason reason = StopReason::none;  ///< where it stops
  std::string_view cause;                ///< why it gave up or stops: one line, or empty
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
  /// The reference of the current goal, where that has a trajectory; else null.
  const ReferenceState* reference = nullptr;
  /// Number of the World's snapshot that the answer is for.
  std::uint64_t snapshot = 0;
  /// Number of what the arm carries: 0 at first, else what attach() or detach() returned last of
  /// those that took effect; and of the last one that was refused, with the reason, one line.
  std::uint64_t load = 0, refused_load = 0;
  std::string_view load_refusal;
  /// The planner's own figures, see Controller::series(); NaN where it set none.
  std::span<const double> series;
  /// Time that the planner took by Options::clock_s [s], and in how many ticks since the start it
  /// took longer than the deadline; 0 without a clock.
  double planner_s = 0.0;
  std::uint64_t overruns = 0;
};

/// What a scene's guide did since the start.
struct GuideFigures {
  long searches = 0, found = 0;
  long kept = 0;        ///< paths that were still clear after a change of the world
  long checks = 0;      ///< of all answers
  double waited_s = 0;  ///< for which the arm held its place
  double length = 0;    ///< of the last path [rad or m]
};

/// The lines that a planner drew in the last tick in which it drew any: their points [m], line by
/// line.
struct Drawing {
  std::uint64_t number = 0;             ///< of the drawing; 0: none was made
  std::vector<Eigen::Vector3d> points;  ///< in the world
  std::vector<std::size_t> ends;        ///< of each line, in points
};

/// The goal of a tick as the planner sees it. `number` is another one whenever the goal is another
/// one.
struct PlannerGoal {
  const hamelin_goal* goal;
  std::uint64_t number;
  std::size_t index;
};

}  // namespace hamelin::control

#pragma once
#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "hamelin/control/live_reference.hpp"
#include "hamelin/control/live_target.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/scene/allowance.hpp"

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
  /// What the current goal may touch, where that is anything; else null. No proof and no distance
  /// regards it.
  const scene::Allowance* may_touch = nullptr;
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

/// Why a step is refused: what the arm could touch or pass if it made the step and then stopped.
/// torque: no stop within the torque limits exists after it. answer: there is no usable answer.
enum class StopCause : std::int32_t {
  map,
  unknown_space,
  obstacle,
  self,
  joint_limit,
  velocity_limit,
  torque,
  answer
};
inline constexpr std::size_t stop_causes = 8;
[[nodiscard]] std::string_view to_string(StopCause cause) noexcept;

/// What is proved of the obstacles that move, if the arm falls back on its fail-safe motion.
/// clear: it stays clear of them for MoverCheck::horizon_s, as they are predicted. at_rest: of
/// those of which only the speed is bounded, none touches the arm before it rests, or while it
/// comes nearer to them. none: neither.
enum class MoverProof : std::int32_t { clear, at_rest, none };
inline constexpr std::size_t mover_proofs = 3;
[[nodiscard]] std::string_view to_string(MoverProof proof) noexcept;

/// What a shield counted since the start.
struct ShieldCounts {
  long steps = 0;                          ///< that were asked for
  long refused = 0;                        ///< of them
  long at_rest = 0;                        ///< refused while the arm rested
  long stops = 0;                          ///< runs of refused steps
  long longest = 0;                        ///< the longest of them, in steps
  std::array<long, stop_causes> causes{};  ///< of the stops' beginnings
  double strayed = 0.0;        ///< largest deviation of a joint from a stop's motion [rad or m]
  double strayed_share = 0.0;  ///< the same as a share of the bound that the margins cover
  int strayed_joint = -1;      ///< whose share that is
  /// Stops that went on although the world had changed so that they are not clear any more.
  long overtaken = 0;
  /// Steps with moving obstacles in reach, by what is proved after them.
  std::array<long, mover_proofs> proofs{};
  long evasions = 0;    ///< of the stops, those that were followed by a move when they began
  long along_path = 0;  ///< steps that were accepted with a stop along a path
};

/// What a shield did last, and since the start.
struct ShieldReport {
  bool stopping = false;  ///< whether it refused the last step
  bool began = false;     ///< whether that was the first one of a stop
  /// Of the stop in force, which goes on if the next step is refused: whether its motion has ended,
  /// whether it is along a path or else on a straight line, whether it moves on after the arm has
  /// stopped, and where it ends, until the next tick.
  bool at_rest = false, along_path = false, evades = false;
  const Eigen::VectorXd* stop_end = nullptr;
  std::optional<StopCause> cause;  ///< of that
  /// What is proved of moving obstacles after the last step; none if there are none in reach.
  std::optional<MoverProof> proof;
  double largest_margin_m = 0.0;  ///< that any stop required of any shape
  ShieldCounts counts;
};

/// What a scene's guide did since the start.
struct GuideFigures {
  long searches = 0, found = 0;
  long kept = 0;           ///< paths that were still clear after a change of the world
  long checks = 0;         ///< of all answers
  double waited_s = 0;     ///< for which the arm held its place
  double length = 0;       ///< of the last path [rad or m]
  std::size_t option = 0;  ///< of several goals the one that it leads to
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
  const std::vector<scene::TipConstraint>* constraints;  ///< kept on the way to it; null: none
};

}  // namespace hamelin::control

#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "hamelin/io/json.hpp"

namespace hamelin::log {

enum class Outcome : std::int32_t {
  completed,  ///< free motion ran to its end
  reached,
  followed,     ///< a target was followed to the end of the run, or of its stream
  target_lost,  ///< the stream of targets broke off in a scene that ends then
  stalled,
  collision,
  timeout,
  diverged,  ///< a step found no root, or numbers became infinite or NaN
  defect,    ///< an internal check failed: of an energy account or of a plugin's answer
  refused,   ///< the start is in contact
  interrupted,
};
[[nodiscard]] std::string_view to_string(Outcome outcome) noexcept;
/// Exit code of the program: 0 completed, reached or followed, 1 goal not reached or target lost, 2
/// refused, 3 diverged or
/// defect, 130 interrupted.
[[nodiscard]] int exit_code(Outcome outcome) noexcept;

/// Statistics of the integrator over all steps, from its StepReports.
struct SolverSummary {
  long steps = 0;
  long updates = 0, factorizations = 0, evaluations = 0, halvings = 0, rejected = 0;
  int updates_max = 0;
  double residual_max = 0.0;
  std::string criterion;
  double tolerance = 0.0;
};

/// By how much the torque of a joint changes from tick to tick: of each tick the largest change of
/// all joints [Nm or N].
struct TorqueChange {
  long ticks = 0;
  double sum = 0.0, max = 0.0;
  void add(double change) {
    ++ticks;
    sum += change;
    max = std::max(max, change);
  }
  [[nodiscard]] double mean() const { return ticks > 0 ? sum / static_cast<double>(ticks) : 0.0; }
};

/// The outcome of one run, as `--result` writes it (docs/logs.md). Fields that do not apply stay
/// empty and are written as null.
struct Result {
  std::string scene, integrator;
  std::optional<std::string> planner;
  Outcome outcome = Outcome::completed;
  std::string cause;  ///< empty if the run succeeded
  double time_s = 0.0;
  long steps = 0;
  Eigen::VectorXd q, v;
  /// By how much a joint was beyond its limits at any node, where limits are modelled: of position
  /// [rad or m] and of speed [rad/s or m/s]; zero if never.
  std::optional<double> position_excess, speed_excess;
  // Largest values of each joint, empty in free motion; h is the step.
  Eigen::VectorXd v_abs_max;     ///< speed at any node [rad/s or m/s]
  Eigen::VectorXd a_abs_max;     ///< |Δv/h| between two nodes
  Eigen::VectorXd jerk_abs_max;  ///< |Δ(Δv/h)/h|
  double energy_initial_J = 0.0, energy_final_J = 0.0;
  double energy_error_max_J = 0.0;  ///< largest |E_k − E_0 − booked work| over all nodes k
  std::optional<double> min_clearance_m, min_self_clearance_m;
  struct Goal {
    std::string type;
    std::size_t index = 0, count = 0;  ///< number of goals reached, and of all goals
    std::optional<double> error_m, error_rad;
  };
  std::optional<Goal> goal;
  /// How well the tip followed a target. It is free while a posture that holds it is found near the
  /// arm's own, with a straight way there that is clear; see simulation::TrackingAudit.
  struct Following {
    /// Over some time: root mean square and largest error of position and orientation.
    struct Errors {
      double time_s = 0.0, rms_m = 0.0, max_m = 0.0, rms_rad = 0.0, max_rad = 0.0;
    };
    Errors all, free;        ///< always, and while the target was free
    double tracked_s = 0.0;  ///< within the tolerances of the goal
    double free_not_tracked_s = 0.0;
    double lost_s = 0.0;                 ///< after the stream broke off
    long resumed = 0;                    ///< times a target became free again and was tracked again
    long not_resumed = 0;                ///< times it was no longer free before that
    std::optional<double> resume_max_s;  ///< longest time from free to tracked, or to the end
    long refused_lines = 0;              ///< of the stream
  };
  std::optional<Following> following;
  /// What a goal may touch.
  struct MayTouch {
    std::size_t goal = 0;  ///< the first has number 1
    Json what;             ///< as in the scene
    /// Smallest distance from it and from all obstacles while the goal was the current one, at most
    /// that up to which obstacles are found [m].
    double clearance_m = 0.0;
  };
  std::vector<MayTouch> may_touch;
  /// What the tip has to keep on the way to a goal.
  struct Constraint {
    std::size_t goal = 0, constraint = 0;  ///< the first have number 1
    std::string type;                      ///< "axis", "box" or "speed"
    /// By how much it was exceeded at most, negative if it was kept [rad, m or m/s], and
    /// when.
    double excess = 0.0, time_s = 0.0;
  };
  std::vector<Constraint> constraints;
  /// How well the arm followed the trajectories of goals, tick by tick.
  struct Trajectory {
    double duration_s = 0.0;  ///< of those that were begun
    double time_s = 0.0;      ///< that the arm took for them; more where it was held up
    /// Root mean square and maximum of the largest distance of a joint from the reference
    /// [rad or m].
    double error_rms = 0.0, error_max = 0.0;
  };
  std::optional<Trajectory> trajectory;
  SolverSummary solver;
  double gyroscopic_work_J = 0.0, filter_work_J = 0.0, recovery_work_J = 0.0, dissipated_J = 0.0,
         held_work_J = 0.0;
  double external_work_J = 0.0;  ///< of the surroundings' wrenches
  double node_work_J = 0.0;      ///< of node velocities: law, filter and recovery together
  std::optional<TorqueChange> torque_change;  ///< under sampled actuation
  std::optional<double> saturated_share;  ///< of all steps; null if torque limits are not modelled
  std::optional<double> certified_share;  ///< of all steps; null if nothing can be hit
  std::optional<double> tightest_step_m;  ///< smallest margin by which a step was certified
  /// What the scene's shield did; docs/theory.md chapter 14.
  struct Shield {
    double margin_m = 0.0;  ///< the largest of any shape
    long steps = 0, refused = 0, refused_at_rest = 0;
    long along_path = 0;  ///< steps accepted with a stop along the path
    long stops = 0, longest_stop_steps = 0;
    std::vector<std::pair<std::string, long>> causes;  ///< of stops, those that occurred
    double strayed_rad = 0.0;    ///< largest deviation of a joint from a stop's motion [rad or m]
    double strayed_share = 0.0;  ///< the same as a share of the bound; above 1 it was exceeded
    long overtaken = 0;          ///< stops that are not clear any more since the world changed
    long evasions = 0;           ///< stops that lead out of a moving obstacle's way
    /// Number of steps with moving obstacles in reach by what was proved after them, and the
    /// weakest of all; empty if there were none.
    std::vector<std::pair<std::string, long>> mover_steps;
    std::optional<std::string> movers;
    double work_J = 0.0;  ///< of the torques of stops
  };
  std::optional<Shield> shield;
  /// What the scene's guide did.
  struct Guide {
    std::string type;
    long searches = 0, found = 0;
    long kept = 0;                 ///< paths that were still clear after a change of the world
    long checks = 0;               ///< of all searches
    double waited_s = 0.0;         ///< simulated time for which the arm held its place
    std::optional<double> length;  ///< of the last path [rad or m]
  };
  std::optional<Guide> guide;
  /// What the scene's sensors showed the controller.
  struct Sensors {
    long frames = 0, refused = 0;
    std::size_t points = 0;                 ///< that became part of its map
    std::size_t on_arm = 0;                 ///< left out: on the arm or its load
    std::size_t occupied = 0, cleared = 0;  ///< voxels, each time
  };
  std::optional<Sensors> sensors;
  /// A plant other than hamelin's own, with the contacts that it and the judge counted.
  struct Plant {
    std::string type, version;
    long contacts = 0, judge_contacts = 0;  ///< nodes in contact
    std::optional<double> deepest_m;        ///< of the plant's contacts, negative inside
  };
  std::optional<Plant> plant;
  /// The contact with an obstacle that moves or appears at which the run ended, whether the arm
  /// moved or stood.
  struct MoverContact {
    std::string obstacle, link, prediction;
    double time_s = 0.0;
    double arm_speed_m_s = 0.0, obstacle_speed_m_s = 0.0;  ///< of the points that touch
    double closing_speed_m_s = 0.0;                        ///< along the direction between them
    /// By how much the obstacle's place at the contact differed from the prediction made
    /// `ahead_s` before [m]. Empty where the obstacle did not exist then.
    struct Error {
      double ahead_s, error_m;
    };
    std::vector<Error> prediction_errors;
  };
  std::optional<MoverContact> mover_contact;
  std::uint64_t seed = 0;
  std::vector<std::string> warnings;
  // The rest depends on clock and machine.
  double cpu_s = 0.0;
  struct TickTime {
    double p50 = 0.0, p99 = 0.0, max = 0.0;  ///< [µs]
  };
  std::optional<TickTime> tick_us;        ///< thread CPU time
  std::optional<TickTime> controller_us;  ///< wall time of the controller, without the guide
  std::optional<TickTime> planner_us;     ///< wall time of the planner alone
  std::optional<double> deadline_us;      ///< wall time that a planner should not exceed
  std::uint64_t late_ticks = 0;           ///< how often it did
  Json provenance = Json::object();
};

/// The result as JSON, schema "hamelin.result/1". Non-finite numbers become null and are named in
/// "warnings".
[[nodiscard]] Json to_json(const Result& result);

}  // namespace hamelin::log

#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <memory>

#include "evader.hpp"
#include "follower.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/planning/joint_path.hpp"
#include "hamelin/planning/plugin.hpp"
#include "parts.hpp"
#include "stall.hpp"
#include "tuning.hpp"

namespace hamelin::hybrid {

/// Distance of the carrot ahead of the arm on a path [rad or m].
inline constexpr double path_ahead = 0.25;

/// How the arm takes up the desired velocity of a tick.
struct Motion {
  double gain, acceleration;   ///< as in FilterDrive::accelerate()
  Pace pace;                   ///< at which limits are approached
  double closing_speed = 0.0;  ///< at which the law shortens the distance
  bool from_present = false;   ///< whether v counts, not the velocity that the arm coasts to
  double softness = 0.0;       ///< of rows of what stands still, as in begin_filter()
  bool keeps_path = false;     ///< whether the path itself keeps what the tip is to keep
};

/// What the courses work with: the state of the arm, law and filter, and what is known of the goal.
struct Shared {
  Shared(const planning::Host& host, const planning::Setup& setup, const Json& params);
  Shared(const Shared&) = delete;
  Shared& operator=(const Shared&) = delete;
  void set_tuning(const Tuning& new_tuning);

  [[nodiscard]] bool follows() const { return goal->type == HAMELIN_GOAL_FOLLOW; }
  [[nodiscard]] std::int32_t path_search() const {
    return HAMELIN_HAS_FIELD(goal, hamelin_goal, path_search) ? goal->path_search
                                                              : HAMELIN_PATH_NOT_SOUGHT;
  }
  void clear_path() {
    path.clear();
    path_position = 0.0;
  }
  /// Takes the path that the goal has, which may be none.
  void take_path();
  /// Asks for a path. @return whether one will be searched; if not, none is asked for again
  [[nodiscard]] bool request_path() { return searches = searches && host.request_path(); }
  /// Sets the target of a tick: the goal, or the carrot on the path.
  void choose_target();

  [[nodiscard]] Evader::Arm arm() const {
    return {drive.ws(), drive.q(), drive.v(), drive.M(), drive.M_inv()};
  }
  [[nodiscard]] Pace pace() const {
    return {tuning.acceleration_max, tuning.brake_acceleration, tuning.approach_rate,
            0.5 * tuning.acceleration_max};
  }
  /// The motion of most courses.
  [[nodiscard]] Motion motion(double gain) const {
    return {gain, tuning.drive_acceleration, pace()};
  }
  [[nodiscard]] double distance(const Target& to) {
    return law.distance(model, drive.ws(), drive.q(), to);
  }
  /// The length that remains: the distance from the target, and the path behind it.
  [[nodiscard]] double remaining();
  /// The arm at the end of a tick, for the watch of stalls.
  [[nodiscard]] StallWatch::Moment moment(double time_s, double closing_speed) {
    return {time_s,          remaining(),    drive.v().norm(), closing_speed, drive.held_back(),
            evader.evades(), evader.active()};
  }
  /// Sets u to the attraction to the target, slower where the scene requires it.
  /// @return the speed at which the attraction shortens the distance
  double attract(const planning::Tick& tick);
  /// Lets the steering predict where the arm comes: docs/theory.md (10.40).
  void look_for_turns(const planning::Tick& tick, double distance);

  planning::Host host;
  planning::Setup setup;
  model::Model model;
  Tuning tuning;
  Law law;
  FilterDrive drive;
  Surroundings surroundings;
  PointMargins margins;
  Evader evader;
  std::unique_ptr<Steering> steering;  ///< null: the desired velocity is not turned
  StallWatch stall;

  const hamelin_goal* goal = nullptr;  ///< of goal_number
  std::uint64_t goal_number = 0;
  bool asks;              ///< for paths
  bool searches = false;  ///< whether it may still ask at this goal
  planning::JointPath path;
  double path_position = 0.0;
  Target target;                 ///< of the tick
  Eigen::VectorXd via;           ///< the carrot, if there is a path
  Eigen::VectorXd u;             ///< desired velocity
  Eigen::VectorXd lower, upper;  ///< its bounds, where a target is followed

  // Of a target that moves. They outlast the goal.
  Follower follower;
  TargetAnchor anchor;           ///< the last place of the target to which a way was searched
  double blocked_since_s = 0.0;  ///< since when the arm has been kept from the target
};

}  // namespace hamelin::hybrid

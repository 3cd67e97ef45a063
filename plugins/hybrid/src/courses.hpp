#pragma once
#include <optional>
#include <variant>

#include "hamelin/planning/plugin.hpp"
#include "shared.hpp"

/// What the arm does, one type per course. `step` sets the desired velocity of a tick and says how
/// the arm takes it up; `check` decides after the tick whether another course follows.
namespace hamelin::hybrid {

struct Straight;
struct AlongPath;
struct Wait;
struct Pursuit;
struct PathToTarget;

/// The arm's own course, which lasts until another one follows or the goal changes.
using Course = std::variant<Straight, AlongPath, Wait, Pursuit, PathToTarget>;
/// The course that follows; none to stay.
using Next = std::optional<Course>;

/// What a check takes: the end of a tick.
struct TickEnd {
  double time_s;
  double closing_speed;  ///< of the motion
  planning::Command& command;
};

/// Heads for a goal at rest by law and steering, without a path.
struct Straight {
  [[nodiscard]] Motion step(Shared& s, const planning::Tick& tick) const;
  [[nodiscard]] Next check(Shared& s, const TickEnd& end) const;
};

/// Follows the carrot on the path to a goal at rest.
struct AlongPath {
  [[nodiscard]] Motion step(Shared& s, const planning::Tick& tick) const;
  [[nodiscard]] Next check(Shared& s, const TickEnd& end) const;
};

/// Stands until another goal is shown, at which the arm waits for a path.
struct Wait {
  [[nodiscard]] Motion step(Shared& s, const planning::Tick& tick) const;
  [[nodiscard]] Next check(Shared& s, const TickEnd& end) const;
};

/// Lets the tip follow a target that moves. An arm that is kept from it asks for a path to where it
/// is, and goes on following. A target is never given up: it may come back.
struct Pursuit {
  [[nodiscard]] Motion step(Shared& s, const planning::Tick& tick) const;
  [[nodiscard]] Next check(Shared& s, const TickEnd& end);

  bool awaits_path = false;  ///< to the anchor
};

/// Follows a path to where the target was, until the target is near or the path has ended.
struct PathToTarget {
  [[nodiscard]] Motion step(Shared& s, const planning::Tick& tick) const;
  [[nodiscard]] Next check(Shared& s, const TickEnd& end) const;
};

/// Keeps the times of the goal's trajectory, docs/theory.md (18.17): for the ticks at which an arm
/// that heads for a goal at rest is near the reference.
struct Track {
  /// @return none away from the reference, where the trajectory is a path
  [[nodiscard]] static std::optional<Track> near_reference(const Shared& s,
                                                           const planning::Tick& tick);
  [[nodiscard]] Motion step(Shared& s, const planning::Tick& tick) const;

  bool certified;  ///< whether the trajectory is proved to be clear
};

/// Evades what moves: for the ticks at which the evader leaves the arm's own course.
struct Evade {
  [[nodiscard]] Motion step(Shared& s) const;
};

/// The target counts as reached within so much [m and ½ rad].
inline constexpr double target_away = 0.06;

}  // namespace hamelin::hybrid

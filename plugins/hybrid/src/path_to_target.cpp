#include <Eigen/Core>

#include "courses.hpp"

namespace hamelin::hybrid {

namespace {

// Largest |error| of a joint at the end of a path to a target [rad or m].
constexpr double path_end_reached = 0.1;

// A path to a place of the target ends there, or where the arm is stuck.
bool path_has_ended(Shared& s, double now) {
  if (s.stall.stands(s.moment(now, 1.0))) return true;
  return s.path_position >= s.path.length() &&
         (s.path.end() - s.drive.q()).lpNorm<Eigen::Infinity>() < path_end_reached;
}

}  // namespace

Motion PathToTarget::step(Shared& s, const planning::Tick& tick) const {
  return AlongPath{}.step(s, tick);
}

Next PathToTarget::check(Shared& s, const TickEnd& end) const {
  end.command.disable_stall_rule();
  const bool is_near = s.distance({s.goal}) < target_away;
  if (!is_near && !path_has_ended(s, end.time_s)) return std::nullopt;
  s.clear_path();
  s.follower.restart();
  s.blocked_since_s = end.time_s;
  return Pursuit{};
}

}  // namespace hamelin::hybrid

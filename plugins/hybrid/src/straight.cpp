#include <algorithm>

#include "courses.hpp"
#include "stalls.hpp"

namespace hamelin::hybrid {

namespace {

// A stall is left to steering for a while, and if there is no search, until it has tried all it
// knows many times.
bool steers_on(const Shared& s, double now) {
  constexpr double steered_s = 10.0;
  if (!s.searches) return s.steering->looks_in_vain() < Steering::looks_enough;
  return (s.steering->turn().on() || s.steering->arrives()) &&
         now - s.steering->in_vain_since_s() < steered_s;
}

}  // namespace

Motion Straight::step(Shared& s, const planning::Tick& tick) const {
  Motion motion = s.motion(s.tuning.velocity_gain);
  motion.closing_speed = s.attract(tick);
  const double distance = s.distance(s.target);
  if (s.steering) {
    s.look_for_turns(tick, distance);
    s.steering->apply(s.drive.M(), s.u);
  }
  s.law.repel(s.drive.points(), std::min(1.0, distance), s.u);
  return motion;
}

Next Straight::check(Shared& s, const TickEnd& end) const {
  if (!has_stalled(s, end)) return std::nullopt;
  if (!s.steering || !steers_on(s, end.time_s)) return leave_stall(s, end);
  s.stall.extend(end.time_s);
  return std::nullopt;
}

}  // namespace hamelin::hybrid

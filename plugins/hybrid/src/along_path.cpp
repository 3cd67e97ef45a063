#include <algorithm>

#include "courses.hpp"
#include "stalls.hpp"

namespace hamelin::hybrid {

Motion AlongPath::step(Shared& s, const planning::Tick& tick) const {
  Motion motion = s.motion(s.tuning.follow_gain);
  motion.closing_speed = s.attract(tick);
  s.law.repel(s.drive.points(), std::min(1.0, s.distance(s.target)), s.u);
  return motion;
}

// If something that the path does not know bars it, turns lead past it and on to the goal. Where
// nothing moves, another path is better.
Next AlongPath::check(Shared& s, const TickEnd& end) const {
  if (!has_stalled(s, end)) return std::nullopt;
  if (!s.steering || (s.searches && !s.evader.active())) return leave_stall(s, end);
  s.host.info("stalled: turns lead on from the path");
  s.clear_path();
  s.steering->restart();
  return Straight{};
}

}  // namespace hamelin::hybrid

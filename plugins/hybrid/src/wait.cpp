#include "courses.hpp"

namespace hamelin::hybrid {

// An arm that has stalled on a path waits there.
Motion Wait::step(Shared& s, const planning::Tick& /*tick*/) const {
  s.u.setZero();
  return s.motion(s.path.empty() ? s.tuning.velocity_gain : s.tuning.follow_gain);
}

Next Wait::check(Shared& s, const TickEnd& end) const {
  if (s.asks || s.steering) end.command.disable_stall_rule();
  return std::nullopt;
}

}  // namespace hamelin::hybrid

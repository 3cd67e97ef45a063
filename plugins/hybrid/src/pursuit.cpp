#include <tuple>

#include "courses.hpp"

namespace hamelin::hybrid {

namespace {

// An arm that is kept from its target, farther than target_away, for so long and up to this share
// of the desired motion, asks for a way to it, and if there was none, asks again after the same
// time: the target moves on. To a target that rests it asks a few times.
constexpr double target_blocked_s = 0.2, target_blocked_share = 0.3;
constexpr int target_searches = 3;

bool is_held(const Shared& s, double distance) {
  return s.follower.progress() <= target_blocked_share && distance >= target_away;
}
bool was_held(const Shared& s, double now) {
  return now - s.blocked_since_s > target_blocked_s;
}

void follow(Shared& s, const planning::Tick& tick) {
  s.follower.observe(s.drive.ws(), s.drive.v(), s.setup.control_period_s());
  for (int k = 0; k < s.setup.dof(); ++k)
    std::tie(s.lower[k], s.upper[k]) = s.drive.joint_bounds(k, s.pace());
  s.follower.velocity(s.drive.ws(), s.drive.q(), *s.goal, s.drive.points(),
                      1.0 / s.tuning.target_velocity_gain, s.lower, s.upper, s.u);
  if (tick.speed_scale() < 1.0) s.u *= tick.speed_scale();
  s.follower.keep_clear(s.drive.points(), s.tuning.brake_acceleration, s.tuning.approach_rate,
                        s.lower, s.upper, s.u);
}

void turn(Shared& s, const planning::Tick& tick) {
  s.look_for_turns(tick, s.distance({s.goal}));
  if (!s.steering->turn().on()) return;
  s.law.attract(s.model, s.drive.ws(), s.drive.q(), {s.goal}, s.u);
  s.u *= tick.speed_scale();
  s.steering->apply(s.drive.M(), s.u);
  s.law.repel(s.drive.points(), 1.0, s.u);
}

// @return whether a path will be searched
bool search(Shared& s) {
  if (s.anchor.searches > 0 && !s.anchor.left_by(*s.goal)) {
    if (s.anchor.searches >= target_searches) return false;
    ++s.anchor.searches;
  } else {
    s.anchor.set(*s.goal);
    s.anchor.searches = 1;
  }
  if (!s.request_path()) return false;
  s.host.info("searches a way to the target");
  return true;
}

}  // namespace

// Without a search, an arm that is kept from its target turns where that leads to it.
Motion Pursuit::step(Shared& s, const planning::Tick& tick) const {
  follow(s, tick);
  if (s.steering && !s.searches && was_held(s, tick.time_s())) turn(s, tick);
  return s.motion(s.tuning.target_velocity_gain);
}

Next Pursuit::check(Shared& s, const TickEnd& end) {
  end.command.disable_stall_rule();
  const double now = end.time_s, distance = s.distance({s.goal});
  if (awaits_path) {
    if (s.path_search() == HAMELIN_PATH_SOUGHT) return std::nullopt;
    awaits_path = false;
    s.blocked_since_s = now;
    if (s.path_search() != HAMELIN_PATH_FOUND || distance < target_away) return std::nullopt;
    s.take_path();
    return PathToTarget{};
  }
  if (s.searches) {
    if (!is_held(s, distance)) s.blocked_since_s = now;
    if (was_held(s, now)) {
      s.blocked_since_s = now;
      awaits_path = search(s);
    }
  } else if (s.steering && !s.steering->turn().on() && !is_held(s, distance)) {
    if (was_held(s, now)) s.steering->restart();
    s.blocked_since_s = now;
  }
  return std::nullopt;
}

}  // namespace hamelin::hybrid

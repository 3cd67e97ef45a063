#include <Eigen/Core>
#include <algorithm>

#include "courses.hpp"

namespace hamelin::hybrid {

namespace {

// An arm so near to the reference of a trajectory tracks it [rad or m], unless its clock hardly
// runs: then something holds the arm up, and the trajectory is a path.
constexpr double track_within = 0.1, track_rate_least = 0.1;
// It was planned to be clear, so it may come near to obstacles and joint limits fast: braking
// [m/s^2] and rate [1/s] as in (10.10).
constexpr double track_brake = 20.0;
double track_rate_within(double horizon_s) {
  return std::min(100.0, 0.5 / horizon_s);
}

// As the feedback of a stop, whose bounds are those of the tube: docs/theory.md (14.14).
double certified_gain(double period_s) {
  constexpr double feedback_rate = 50.0, per_step = 0.2;
  return 2.0 * std::min(feedback_rate, per_step / period_s);
}

double distance_from(const planning::Reference& reference, const Shared& s) {
  return (reference.q - s.drive.q()).lpNorm<Eigen::Infinity>();
}

}  // namespace

std::optional<Track> Track::near_reference(const Shared& s, const planning::Tick& tick) {
  const auto reference = tick.reference();
  const bool is_near = reference && (reference->certified || reference->rate > track_rate_least) &&
                       distance_from(*reference, s) < track_within;
  if (!is_near) return std::nullopt;
  return Track{reference->certified};
}

Motion Track::step(Shared& s, const planning::Tick& tick) const {
  const auto reference = *tick.reference();
  // Under ideal actuation v is that of the step before, on average half a period old.
  const double period_s = s.setup.control_period_s(),
               gain = certified ? certified_gain(period_s) : s.tuning.target_velocity_gain;
  const double lead = 1.0 / gain - (s.setup.sampled() ? 0.0 : 0.5 * period_s);
  s.u = reference.v + lead * reference.a +
        (certified ? 0.25 * gain : s.tuning.follow.gain) * (reference.q - s.drive.q());
  if (tick.speed_scale() < 1.0) s.u *= tick.speed_scale();

  constexpr double on_path = 0.005;
  const double rate = track_rate_within(s.drive.horizon_s()),
               acceleration = certified ? s.tuning.path_acceleration : s.tuning.acceleration_max;
  Motion motion{gain, acceleration, {acceleration, track_brake, rate, acceleration, rate}};
  // A reference accelerates as the motors can, so the velocity that counts is the present one.
  motion.from_present = true;
  motion.softness = certified ? -1.0 : 0.0;
  motion.keeps_path = certified && distance_from(reference, s) < on_path;
  return motion;
}

}  // namespace hamelin::hybrid

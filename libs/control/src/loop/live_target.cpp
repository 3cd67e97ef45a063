#include "hamelin/control/live_target.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/geometry/so3.hpp"

namespace hamelin::control {

using Eigen::Vector3d;

namespace {

// Root mean square of the jerk of targets up to 1 Hz, see ObservationOptions.
constexpr double usual_jerk_m_s3 = 2.0, usual_jerk_rad_s3 = 10.0;

constexpr double rounding_s = 1e-9;  // of differences of times

[[noreturn]] void refuse_target(const std::string& what) {
  throw Error(ErrorCode::invalid, fmt::format("target: {}", what));
}

void require_finite(bool finite, const char* what) {
  if (!finite) refuse_target(fmt::format("{} is not finite, expected finite numbers", what));
}

// Shortens x to at most this length.
Vector3d shortened(const Vector3d& x, double longest) {
  const double length = x.norm();
  return length > longest ? Vector3d(x * (longest / length)) : x;
}

}  // namespace

void TargetReceiver::start(const scene::TargetStream& bounds) {
  bounds_ = bounds;
  last_ = {};
  estimator_.reset();
}

void TargetReceiver::check_time(double time_s) const {
  require_finite(std::isfinite(time_s), "time_s");
  if (last_.kind != StreamedTarget::Kind::none && !(time_s > last_.time_s))
    refuse_target(fmt::format("time_s is {}, expected a time after that of the last one, {}",
                              time_s, last_.time_s));
}

// docs/theory.md (16.1)
void TargetReceiver::check_jump(const TargetPose& pose) const {
  if (last_.kind != StreamedTarget::Kind::pose) return;
  const double elapsed = pose.time_s - last_.time_s;
  if (elapsed > bounds_.gap_max_s) return;
  const scene::MotionState expected = scene::extrapolated(last_.motion, elapsed, false);
  const double jump = (pose.pose.p() - expected.pose.p()).norm(),
               turn = geometry::SO3(pose.pose.R() * expected.pose.R().transpose()).log().norm();
  if (jump > bounds_.jump_max_m)
    refuse_target(
        fmt::format("the position jumps by {:.3g} m, expected at most {} m from where "
                    "the last motion leads",
                    jump, bounds_.jump_max_m));
  if (turn > bounds_.jump_max_rad)
    refuse_target(
        fmt::format("the orientation jumps by {:.3g} rad, expected at most {} rad from "
                    "where the last motion leads",
                    turn, bounds_.jump_max_rad));
}

StreamedTarget TargetReceiver::take(const TargetPose& pose) {
  check_time(pose.time_s);
  require_finite(pose.pose.p().allFinite(), "the position");
  require_finite(pose.pose.R().allFinite(), "the orientation");
  for (const auto* given :
       {&pose.velocity_m_s, &pose.acceleration_m_s2, &pose.angular_velocity_rad_s})
    require_finite(!*given || (*given)->allFinite(), "a velocity or acceleration");
  check_jump(pose);
  const bool goes_on = estimator_ && pose.time_s - last_.time_s <= bounds_.gap_max_s;
  if (goes_on)
    estimator_->update(pose.time_s, pose.pose);
  else
    estimator_.emplace(
        ObservationOptions{bounds_.noise_m, bounds_.noise_rad, usual_jerk_m_s3, usual_jerk_rad_s3},
        pose.time_s, pose.pose);
  last_.kind = StreamedTarget::Kind::pose;
  last_.time_s = pose.time_s;
  last_.motion.pose = pose.pose;
  if (!pose.velocity_m_s) last_.motion.pose = {estimator_->rotation(), estimator_->position()};
  last_.motion.velocity = pose.velocity_m_s.value_or(estimator_->velocity());
  last_.motion.acceleration = pose.acceleration_m_s2.value_or(estimator_->acceleration());
  last_.motion.angular_velocity =
      pose.angular_velocity_rad_s.value_or(estimator_->angular_velocity());
  return last_;
}

StreamedTarget TargetReceiver::take(const TargetTwist& twist) {
  check_time(twist.time_s);
  require_finite(twist.velocity_m_s.allFinite() && twist.angular_velocity_rad_s.allFinite(),
                 "the twist");
  estimator_.reset();
  last_ = {StreamedTarget::Kind::twist, twist.time_s, {}};
  last_.motion.velocity = twist.velocity_m_s;
  last_.motion.angular_velocity = twist.angular_velocity_rad_s;
  return last_;
}

void LiveTarget::start(const scene::Goal& goal, const geometry::SE3& tip) {
  goal_ = &goal;
  state_ = {};
  state_.pose = tip;
  state_.waiting = !goal.motion;
  driven_ = false;
}

const TargetState& LiveTarget::update(double time_s, const StreamedTarget& streamed,
                                      const geometry::SE3& tip) {
  if (goal_->motion) {
    static_cast<scene::MotionState&>(state_) =
        scene::motion_at({goal_->pose, goal_->motion, nullptr}, time_s);
  } else if (streamed.kind != StreamedTarget::Kind::none) {
    state_.waiting = false;
    if (streamed.kind == StreamedTarget::Kind::pose)
      extrapolate(streamed, time_s);
    else
      move_by_twist(streamed, time_s, tip);
  }
  time_s_ = time_s;
  return state_;
}

// docs/theory.md (16.2)
void LiveTarget::extrapolate(const StreamedTarget& streamed, double time_s) {
  const double age = time_s - streamed.time_s, longest = goal_->stream.gap_max_s;
  static_cast<scene::MotionState&>(state_) =
      scene::extrapolated(streamed.motion, std::min(age, longest), false);
  state_.acceleration = streamed.motion.acceleration;
  driven_ = false;
  state_.lost = age > longest + rounding_s;
  if (!state_.lost) return;
  for (auto* rate : {&state_.velocity, &state_.acceleration, &state_.angular_velocity})
    rate->setZero();
}

// docs/theory.md (16.3)
void LiveTarget::move_by_twist(const StreamedTarget& streamed, double time_s,
                               const geometry::SE3& tip) {
  const bool goes_on = std::exchange(driven_, true);
  const double elapsed = goes_on ? time_s - time_s_ : 0.0;
  if (!goes_on) state_.pose = tip;
  const bool commanded =
      !streamed.motion.velocity.isZero(0.0) || !streamed.motion.angular_velocity.isZero(0.0);
  state_.lost = commanded && time_s - streamed.time_s > goal_->stream.gap_max_s + rounding_s;
  const bool moves = commanded && !state_.lost;
  state_.velocity = moves ? streamed.motion.velocity : Vector3d::Zero();
  state_.angular_velocity = moves ? streamed.motion.angular_velocity : Vector3d::Zero();
  state_.acceleration.setZero();
  if (!moves) return;
  const Vector3d p = state_.pose.p() + elapsed * state_.velocity;
  const Eigen::Matrix3d R =
      geometry::SO3::exp(elapsed * state_.angular_velocity).R() * state_.pose.R();
  const Vector3d turned = geometry::SO3(R * tip.R().transpose()).log();
  state_.pose = {geometry::SO3::exp(shortened(turned, goal_->stream.leash_rad)).R() * tip.R(),
                 tip.p() + shortened(p - tip.p(), goal_->stream.leash_m)};
}

}  // namespace hamelin::control

#include "hamelin/scene/motion.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "hamelin/core/error.hpp"
#include "hamelin/geometry/so3.hpp"

namespace hamelin::scene {

using Eigen::Vector3d;

namespace {

// Of a frame in its parent.
MotionState own_state(const Frame& frame, const SineMotion& sine, double time_s) {
  const double omega = 2.0 * std::numbers::pi / sine.period_s;
  const double s = std::sin(omega * time_s), c = std::cos(omega * time_s);
  return {{frame.pose.R(), frame.pose.p() + s * sine.amplitude_m},
          omega * c * sine.amplitude_m,
          -omega * omega * s * sine.amplitude_m};
}

MotionState own_state(const Frame& frame, const LinearMotion& line, double time_s) {
  const bool moves = time_s >= line.start_s && time_s - line.start_s < line.duration_s;
  return {
      {frame.pose.R(), frame.pose.p() + std::clamp(time_s - line.start_s, 0.0, line.duration_s) *
                                            line.velocity_m_s},
      moves ? line.velocity_m_s : Vector3d::Zero()};
}

// docs/theory.md (11.40)
MotionState composed(const MotionState& parent, const MotionState& own) {
  const Eigen::Matrix3d& R = parent.pose.R();
  const Vector3d arm = R * own.pose.p(), v = R * own.velocity, turn = R * own.angular_velocity,
                 &omega = parent.angular_velocity, &alpha = parent.angular_acceleration;
  return {parent.pose * own.pose, parent.velocity + omega.cross(arm) + v,
          parent.acceleration + alpha.cross(arm) + omega.cross(omega.cross(arm)) +
              2.0 * omega.cross(v) + R * own.acceleration,
          omega + turn, alpha + omega.cross(turn) + R * own.angular_acceleration};
}

MotionState own_state(const Frame& frame, const WaypointMotion& waypoints, double time_s) {
  const WaypointPath::State at = waypoints.path->at(time_s);
  return composed({{at.rotation, at.position}, at.velocity, at.acceleration, at.angular_velocity},
                  {frame.pose});
}

MotionState own_state(const Frame& frame, const ObservedMotion& seen, double time_s) {
  return extrapolated(
      {frame.pose, seen.velocity_m_s, seen.acceleration_m_s2, seen.angular_velocity_rad_s},
      time_s - seen.time_s, true);
}

MotionBounds own_bounds(const Frame& frame, const SineMotion& sine) {
  const double amplitude = sine.amplitude_m.norm();
  return {2.0 * std::numbers::pi * amplitude / sine.period_s, 0.0,
          frame.pose.p().norm() + amplitude};
}

MotionBounds own_bounds(const Frame& frame, const LinearMotion& line) {
  const double speed = line.velocity_m_s.norm();
  return {speed, 0.0, frame.pose.p().norm() + (speed > 0.0 ? speed * line.duration_s : 0.0)};
}

MotionBounds own_bounds(const Frame& frame, const WaypointMotion& waypoints) {
  const double offset = frame.pose.p().norm(), rate = waypoints.path->rate_max();
  return {waypoints.path->speed_max() + rate * offset, rate,
          waypoints.path->distance_max() + offset};
}

MotionBounds own_bounds(const Frame&, const ObservedMotion& seen) {
  const bool moves = !seen.velocity_m_s.isZero(0.0) || !seen.acceleration_m_s2.isZero(0.0);
  return {seen.velocity_m_s.norm() + acceleration_lasts_s * seen.acceleration_m_s2.norm(),
          seen.angular_velocity_rad_s.norm(),
          moves ? std::numeric_limits<double>::infinity() : 0.0};
}

}  // namespace

MotionState motion_at(const Frame& frame, double time_s) {
  MotionState own{frame.pose};
  if (frame.motion)
    own = std::visit([&](const auto& motion) { return own_state(frame, motion, time_s); },
                     *frame.motion);
  return frame.parent ? composed(motion_at(*frame.parent, time_s), own) : own;
}

// docs/theory.md (11.44)
MotionBounds motion_bounds(const Frame& frame) {
  MotionBounds own{0.0, 0.0, frame.pose.p().norm()};
  if (frame.motion)
    own = std::visit([&](const auto& motion) { return own_bounds(frame, motion); }, *frame.motion);
  if (!frame.parent) return own;
  const MotionBounds parent = motion_bounds(*frame.parent);
  return {parent.speed + (parent.rate > 0.0 ? parent.rate * own.distance : 0.0) + own.speed,
          parent.rate + own.rate, parent.distance + own.distance};
}

MotionState extrapolated(const MotionState& state, double ahead_s, bool accelerates) {
  const double tau = std::max(0.0, ahead_s);
  MotionState out = state;
  out.angular_acceleration.setZero();
  Vector3d moved = tau * state.velocity;
  if (accelerates) {
    const double lasts = std::min(tau, acceleration_lasts_s);
    moved += lasts * (tau - 0.5 * lasts) * state.acceleration;
    out.velocity += lasts * state.acceleration;
  }
  if (!accelerates || tau > acceleration_lasts_s) out.acceleration.setZero();
  out.pose = {
      state.angular_velocity.isZero(0.0)
          ? state.pose.R()
          : Eigen::Matrix3d(geometry::SO3::exp(tau * state.angular_velocity).R() * state.pose.R()),
      state.pose.p() + moved};
  return out;
}

void check(const Motion& motion, const std::string& where) {
  const auto positive = [&](const char* key, double value) {
    if (!(value > 0.0))
      throw Error(
          ErrorCode::invalid,
          fmt::format("{}: {} of the motion is {}, expected a number above 0", where, key, value));
  };
  if (const auto* sine = std::get_if<SineMotion>(&motion)) positive("period_s", sine->period_s);
  if (const auto* line = std::get_if<LinearMotion>(&motion))
    positive("duration_s", line->duration_s);
}

}  // namespace hamelin::scene

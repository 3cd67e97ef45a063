#include "hamelin/control/motion_estimator.hpp"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/geometry/so3.hpp"

namespace hamelin::control {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// At the start, velocity and acceleration are as uncertain as this time of constant jerk makes
// them.
constexpr double start_s = 1.0;

// docs/theory.md (11.46)
Matrix3d transition(double T) {
  return (Matrix3d() << 1.0, T, 0.5 * T * T, 0.0, 1.0, T, 0.0, 0.0, 1.0).finished();
}

Matrix3d process_noise(double t) {
  const double t2 = t * t, t3 = t2 * t, t4 = t3 * t, t5 = t4 * t;
  return (Matrix3d() << t5 / 20.0, t4 / 8.0, t3 / 6.0, t4 / 8.0, t3 / 3.0, t2 / 2.0, t3 / 6.0,
          t2 / 2.0, t)
      .finished();
}

}  // namespace

void check(const ObservationOptions& options) {
  const auto positive = [](const char* key, double value) {
    if (!(value > 0.0 && std::isfinite(value)))
      throw Error(
          ErrorCode::invalid,
          fmt::format("observations: {} is {}, expected a finite number above 0", key, value));
  };
  positive("noise_m", options.noise_m);
  positive("noise_rad", options.noise_rad);
  positive("jerk_m_s3", options.jerk_m_s3);
  positive("jerk_rad_s3", options.jerk_rad_s3);
  positive("timeout_s", options.timeout_s);
}

JerkFilter::JerkFilter(double noise, double jerk)
    : variance_(noise * noise), density_(0.5 * jerk * jerk) {
  const double speed = 0.5 * jerk * start_s * start_s, acceleration = jerk * start_s;
  covariance_ = Vector3d(variance_, speed * speed, acceleration * acceleration).asDiagonal();
}

// docs/theory.md (11.47), (11.48)
Vector3d JerkFilter::advance(double elapsed_s) {
  const Matrix3d F = transition(elapsed_s);
  const Matrix3d P = F * covariance_ * F.transpose() + density_ * process_noise(elapsed_s);
  Vector3d gains = P.col(0) / (P(0, 0) + variance_);
  // Symmetric up to rounding, which must not build up over a long stream.
  const Matrix3d left = P - gains * P.row(0);
  covariance_ = 0.5 * (left + left.transpose());
  return gains;
}

MotionEstimator::MotionEstimator(const ObservationOptions& options, double time_s,
                                 const geometry::SE3& pose)
    : position_filter_(options.noise_m, options.jerk_m_s3),
      rotation_filter_(options.noise_rad, options.jerk_rad_s3),
      time_s_(time_s),
      measured_(pose),
      position_(pose.p()),
      rotation_(pose.R()) {
  velocity_ = acceleration_ = rate_ = rate_change_ = Vector3d::Zero();
}

void MotionEstimator::update(double time_s, const geometry::SE3& pose) {
  const double T = time_s - std::exchange(time_s_, time_s);
  measured_ = pose;
  position_ += T * velocity_ + 0.5 * T * T * acceleration_;
  velocity_ += T * acceleration_;
  const Vector3d error = pose.p() - position_, gain = position_filter_.advance(T);
  position_ += gain[0] * error;
  velocity_ += gain[1] * error;
  acceleration_ += gain[2] * error;

  // docs/theory.md (11.49)
  const auto turn = [&](const Vector3d& by) { rotation_ = geometry::SO3::exp(by).R() * rotation_; };
  turn(T * rate_ + 0.5 * T * T * rate_change_);
  rate_ += T * rate_change_;
  const Vector3d turned = geometry::SO3(pose.R() * rotation_.transpose()).log(),
                 turn_gain = rotation_filter_.advance(T);
  turn(turn_gain[0] * turned);
  rate_ += turn_gain[1] * turned;
  rate_change_ += turn_gain[2] * turned;
}

}  // namespace hamelin::control

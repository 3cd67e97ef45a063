#pragma once
#include <Eigen/Core>
#include <optional>

#include "hamelin/geometry/se3.hpp"

namespace hamelin::control {

/// A pose of an obstacle that a camera or another tracker measured, in the frame of
/// scene::Obstacle::pose. What is not given is estimated from the poses, see MotionEstimator.
struct Observation {
  double time_s = 0.0;  ///< of the measurement, on the clock of Controller::tick()
  geometry::SE3 pose;
  /// In the frame of the positions; velocity and acceleration are those of the origin.
  std::optional<Eigen::Vector3d> velocity_m_s{}, acceleration_m_s2{}, angular_velocity_rad_s{};
};

/// What is known of streams of poses. The defaults suit cameras with 30 to 100 poses per second and
/// errors of 1 to 3 mm, and motions of people and of what they carry.
struct ObservationOptions {
  double noise_m = 0.002;   ///< standard deviation of measured positions, per axis
  double noise_rad = 0.01;  ///< standard deviation of measured rotations, per axis
  /// Root mean square of the jerk at frequencies up to 1 Hz, per axis [m/s³ and rad/s³]. A larger
  /// one follows quick changes better and passes on more noise.
  double jerk_m_s3 = 2.0, jerk_rad_s3 = 5.0;
  double timeout_s = 0.5;  ///< after a longer gap the estimate starts again, at rest
};

/// @throws Error invalid, "observations: …", for numbers that are not finite or not above 0
void check(const ObservationOptions& options);

/// Gains of a Kalman filter of a position whose jerk is white noise, at irregular times:
/// docs/theory.md (11.46)–(11.48). One covariance serves all axes, which have the same noise.
class JerkFilter {
 public:
  JerkFilter(double noise, double jerk);
  /// Gains of position, velocity and acceleration for the error of a measurement, made a time after
  /// the last one, against the prediction.
  [[nodiscard]] Eigen::Vector3d advance(double elapsed_s);

 private:
  double variance_, density_;  ///< of the noise, and of the jerk
  Eigen::Matrix3d covariance_;
};

/// Velocity, acceleration and angular velocity of a body from poses at irregular times. Positions
/// follow (11.46)–(11.48) of docs/theory.md, rotations (11.49). It starts at the first pose, at
/// rest.
class MotionEstimator {
 public:
  MotionEstimator(const ObservationOptions& options, double time_s, const geometry::SE3& pose);

  /// @param time_s later than that of the last pose
  void update(double time_s, const geometry::SE3& pose);

  [[nodiscard]] double time_s() const noexcept { return time_s_; }
  [[nodiscard]] const geometry::SE3& measured() const noexcept { return measured_; }
  /// The estimates at this time, in the frame of the positions.
  [[nodiscard]] const Eigen::Vector3d& position() const noexcept { return position_; }
  [[nodiscard]] const Eigen::Vector3d& velocity() const noexcept { return velocity_; }
  [[nodiscard]] const Eigen::Vector3d& acceleration() const noexcept { return acceleration_; }
  [[nodiscard]] const Eigen::Matrix3d& rotation() const noexcept { return rotation_; }
  [[nodiscard]] const Eigen::Vector3d& angular_velocity() const noexcept { return rate_; }

 private:
  JerkFilter position_filter_, rotation_filter_;
  double time_s_;
  geometry::SE3 measured_;  ///< the last pose
  Eigen::Vector3d position_, velocity_, acceleration_;
  Eigen::Matrix3d rotation_;
  Eigen::Vector3d rate_, rate_change_;  ///< angular velocity and acceleration
};

}  // namespace hamelin::control

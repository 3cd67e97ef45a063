#pragma once
#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "hamelin/geometry/se3.hpp"

namespace hamelin::scene {

/// A rotation as a file gives it, kept beside the pose that was made from it. If it still belongs
/// to the pose, it is written instead of the pose's rotation, and reading it back gives the same
/// bits.
using Quaternion = std::array<double, 4>;

/// Motion p(t) = p_0 + a sin(2πt/T) with the amplitude a, without rotation: docs/theory.md (11.30).
struct SineMotion {
  Eigen::Vector3d amplitude_m = Eigen::Vector3d::Zero();
  double period_s = 1.0;
};

/// Motion p(t) = p_0 + v clamp(t − start, 0, duration) on a line, without rotation:
/// docs/theory.md (11.31).
struct LinearMotion {
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  double start_s = 0.0;
  double duration_s = std::numeric_limits<double>::infinity();
};

/// A pose at a time.
struct Waypoint {
  double time_s = 0.0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Quaternion quaternion_wxyz{1.0, 0.0, 0.0, 0.0};
  int line = 0;  ///< of the text file that it was read from, for messages; 0: none
};

/// A path through poses at given times, docs/theory.md (11.41), (11.42): positions on cubic curves
/// with continuous velocity that do not overshoot, rotations at a constant rate from one way-point
/// to the next. Before the first and after the last way-point it rests there, or it starts again.
class WaypointPath {
 public:
  struct Options {
    bool repeat = false;  ///< starts again at its end; the first and the last pose must be equal
    /// Longest time between two different poses [s]; none: a gap is a time more than 10 times as
    /// long as half of the others.
    std::optional<double> gap_max_s;
  };
  /// @param file that the way-points were read from; empty: none
  /// @throws Error invalid, "where/index: …" or "where: line N: …", for fewer than two way-points,
  ///         times that do not increase, gaps, numbers that are not finite or above 1e9,
  ///         quaternions that are not of unit length, and an end that is not the start if it
  ///         repeats
  WaypointPath(std::vector<Waypoint> waypoints, const Options& options, const std::string& where,
               std::filesystem::path file = {});

  struct State {
    Eigen::Vector3d position, velocity, acceleration;
    Eigen::Matrix3d rotation;
    Eigen::Vector3d angular_velocity;  ///< in the frame of the positions
  };
  [[nodiscard]] State at(double time_s) const;
  /// Upper bounds at all times: of the speed [m/s], of the angular velocity [rad/s], and of the
  /// distance from the origin [m].
  [[nodiscard]] double speed_max() const noexcept { return speed_max_; }
  [[nodiscard]] double rate_max() const noexcept { return rate_max_; }
  [[nodiscard]] double distance_max() const noexcept { return distance_max_; }

  [[nodiscard]] std::span<const Waypoint> waypoints() const noexcept { return waypoints_; }
  [[nodiscard]] const Options& options() const noexcept { return options_; }
  [[nodiscard]] const std::filesystem::path& file() const noexcept { return file_; }

 private:
  void check(const std::string& where) const;
  void set_tangents();
  void set_bounds();

  std::vector<Waypoint> waypoints_;
  Options options_;
  std::filesystem::path file_;
  std::vector<Eigen::Vector3d> tangents_;  ///< velocities at the way-points
  std::vector<Eigen::Matrix3d> rotations_;
  std::vector<Eigen::Vector3d> rates_;  ///< angular velocity from each way-point to the next
  double speed_max_ = 0.0, rate_max_ = 0.0, distance_max_ = 0.0;
};

struct WaypointMotion {
  std::shared_ptr<const WaypointPath> path;
};

/// Reads way-points from CSV with the header time_s,x_m,y_m,z_m and, if it turns, qw,qx,qy,qz, or
/// from JSON: a list of objects with time_s, position_m and quaternion_wxyz, or an object with such
/// a list as "waypoints". CSV may have blank lines, and comments that begin with #.
/// @throws Error io, parse or invalid, "file: line N: …" or "file: /json/pointer: …"
[[nodiscard]] std::vector<Waypoint> read_waypoints(const std::filesystem::path& file);

/// Reads way-points and makes their path. Messages name the line or the place in the file.
/// @throws Error as read_waypoints() and WaypointPath do
[[nodiscard]] WaypointPath read_waypoint_path(const std::filesystem::path& file,
                                              const WaypointPath::Options& options);

/// How an obstacle moves that was observed at a time, where it had its pose: docs/theory.md
/// (11.43).
struct ObservedMotion {
  double time_s = 0.0;
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d acceleration_m_s2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_velocity_rad_s = Eigen::Vector3d::Zero();
};

/// An acceleration that was observed counts for so long; then the velocity stays [s].
inline constexpr double acceleration_lasts_s = 1.0;

using Motion = std::variant<SineMotion, LinearMotion, WaypointMotion, ObservedMotion>;

/// A frame that moves, and may be fixed to another one.
struct Frame {
  geometry::SE3 pose;  ///< at rest, in its parent
  std::optional<Motion> motion;
  std::shared_ptr<const Frame> parent;  ///< null: the world
};

/// Pose and motion of a frame at a time, in the world.
struct MotionState {
  geometry::SE3 pose;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();          ///< of its origin [m/s]
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();      ///< of its origin [m/s²]
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();  ///< [rad/s]
  /// Of frames that turn in frames that turn [rad/s²].
  Eigen::Vector3d angular_acceleration = Eigen::Vector3d::Zero();

  /// Velocity of the point that moves with the frame and is at p now.
  [[nodiscard]] Eigen::Vector3d velocity_at(const Eigen::Vector3d& p) const {
    return velocity + angular_velocity.cross(p - pose.p());
  }
};
[[nodiscard]] MotionState motion_at(const Frame& frame, double time_s);

/// Upper bounds of a frame's motion at all times.
struct MotionBounds {
  double speed = 0.0;     ///< of its origin [m/s]
  double rate = 0.0;      ///< of its angular velocity [rad/s]
  double distance = 0.0;  ///< of its origin from that of the world [m]
};
[[nodiscard]] MotionBounds motion_bounds(const Frame& frame);

/// The frame's state a time later if it keeps its velocities, or also its acceleration:
/// docs/theory.md (11.43).
[[nodiscard]] MotionState extrapolated(const MotionState& state, double ahead_s, bool accelerates);

/// @throws Error invalid, "where: …", for periods and durations that are out of range
void check(const Motion& motion, const std::string& where);

}  // namespace hamelin::scene

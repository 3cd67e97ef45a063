#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"

namespace hamelin::log {

/// The motion in a log. Numbers that were not finite when logged are NaN.
struct Trajectory {
  struct Point {
    double time_s = 0.0;
    Eigen::VectorXd q, v;  ///< one number per joint [rad or m, and per s]
    Eigen::VectorXd tau;   ///< [Nm or N]; empty in free motion
    Eigen::VectorXd a{};   ///< [rad/s² or m/s²]; empty where it is not known
  };

  std::vector<std::string> joints;
  std::vector<Point> points;  ///< one per tick line
};

/// @throws Error io, parse or invalid, naming the line, for a file that is not a log or has no
/// ticks
[[nodiscard]] Trajectory read_trajectory(const std::filesystem::path& log);

/// The same motion at a fixed rate from its first to its last point: cubic Hermite interpolation of
/// q and v, docs/theory.md (13.42); torques are held. The last point is kept, so the last interval
/// may be shorter.
/// @param rate_hz positive and finite @throws Error usage
[[nodiscard]] Trajectory resampled(const Trajectory& trajectory, double rate_hz);

/// Comma-separated values (RFC 4180): time_s, then q_, v_ and, where they are known, tau_ and a_ of
/// each joint. Numbers that are not finite are left empty.
[[nodiscard]] std::string to_csv(const Trajectory& trajectory);

/// The fields of ROS 2's trajectory_msgs/msg/JointTrajectory as JSON.
/// @throws Error invalid if a number is not finite
[[nodiscard]] Json to_joint_trajectory(const Trajectory& trajectory);

}  // namespace hamelin::log

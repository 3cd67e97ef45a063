#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"

namespace hamelin::scene {

/// A motion of the joints over time, given at points. Between two points it is the polynomial of
/// degree five through positions, velocities and accelerations at both, or without accelerations
/// that of degree three: docs/theory.md (18.14), (18.15).
struct JointTrajectory {
  std::vector<std::string> joints;  ///< names, in the order of the rows; empty: as in the robot
  Eigen::VectorXd time_s;           ///< from 0 on, increasing
  Eigen::MatrixXd q, v, a;  ///< dof × points [rad or m, and per s and s²]; `a` may be empty

  [[nodiscard]] Eigen::Index points() const noexcept { return time_s.size(); }
  [[nodiscard]] double duration_s() const { return time_s[points() - 1]; }
  /// Position, velocity and acceleration at a time, which is clamped to the motion. The vectors
  /// must have dof numbers.
  /// @param first index of a point at or before that time
  /// @return the index of the last point at or before it, but the last interval's at the end
  Eigen::Index at(double time_s, Eigen::VectorXd& q, Eigen::VectorXd& v, Eigen::VectorXd& a,
                  Eigen::Index first = 0) const;
};

/// @param where prefix of messages
/// @throws Error invalid for fewer than two points, times that do not begin at 0 or do not
/// increase,
///         sizes that differ, and numbers that are not finite: "where/points/3/time_s: …"
void check(const JointTrajectory& trajectory, const std::string& where);

/// Reads a trajectory of the format hamelin.trajectory/1 (docs/schema/trajectory.schema.json), or
/// the fields of ROS 2's trajectory_msgs/msg/JointTrajectory as JSON, with velocities.
/// @throws Error io, parse or invalid: "file: /json/pointer: what is wrong, what was expected"
[[nodiscard]] JointTrajectory read_joint_trajectory(const std::filesystem::path& file);

/// The same from parsed JSON. @param where prefix of messages
[[nodiscard]] JointTrajectory joint_trajectory_from_json(const Json& document,
                                                         const std::string& where);

/// As hamelin.trajectory/1: joints and points.
[[nodiscard]] Json to_json(const JointTrajectory& trajectory);

}  // namespace hamelin::scene

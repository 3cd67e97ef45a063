#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/log/read_log.hpp"

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

/// Reads the lines of a log one by one, and checks its header and ticks.
class TickReader {
 public:
  /// Reads the header. @throws Error io, parse or invalid for a file that is not a log
  explicit TickReader(const std::filesystem::path& log);

  /// Reads the next line. @return false at the end
  /// @throws Error parse or invalid, naming the line, for a tick that does not match the schema or
  ///         the number of joints, or that is not later than the one before
  bool next();
  [[nodiscard]] const Json& header() const noexcept { return header_; }
  [[nodiscard]] const std::vector<std::string>& joints() const noexcept { return joints_; }
  /// The line that next() read.
  [[nodiscard]] const Json& line() const noexcept { return line_; }
  /// The point of the line; null if the line is not a tick.
  [[nodiscard]] const Trajectory::Point* point() const noexcept {
    return is_tick_ ? &point_ : nullptr;
  }
  /// Knows the position of the line, for messages.
  [[nodiscard]] const LogReader& lines() const noexcept { return reader_; }

 private:
  void read_point();

  LogReader reader_;
  Json header_, line_;
  std::vector<std::string> joints_;
  Trajectory::Point point_;
  bool is_tick_ = false, any_tick_ = false;
};

/// @throws Error io, parse or invalid, naming the line, for a file that is not a log or has no
/// ticks
[[nodiscard]] Trajectory read_trajectory(const std::filesystem::path& log);

/// The same motion at a fixed rate from its first to its last point: cubic Hermite interpolation of
/// q and v, docs/theory.md (13.42); torques are held. The last point is kept, so the last interval
/// may be shorter.
/// @param rate_hz positive and finite @throws Error usage
[[nodiscard]] Trajectory resampled(const Trajectory& trajectory, double rate_hz);

/// The motion between two points, as resampled() computes it.
/// @param time_s from a's time up to, but without, that of b, which is later
[[nodiscard]] Trajectory::Point interpolated(const Trajectory::Point& a, const Trajectory::Point& b,
                                             double time_s);

/// Number of samples before the last point that a rate gives over a span of time. A sample that
/// equals the last point up to rounding is the last point.
/// @throws Error usage for a rate that is not positive and finite, or more than 1e8 samples
[[nodiscard]] long sample_count(double span_s, double rate_hz);

/// Comma-separated values (RFC 4180): time_s, then q_, v_ and, where they are known, tau_ and a_ of
/// each joint. Numbers that are not finite are left empty.
[[nodiscard]] std::string to_csv(const Trajectory& trajectory);

/// The fields of ROS 2's trajectory_msgs/msg/JointTrajectory as JSON.
/// @throws Error invalid if a number is not finite
[[nodiscard]] Json to_joint_trajectory(const Trajectory& trajectory);

}  // namespace hamelin::log

#pragma once
#include <Eigen/Core>

#include "shield/certified_path.hpp"
#include "shield/stop_motion.hpp"

namespace hamelin::control {

/// The motion that a shield falls back on: the arm stops, on a straight line or along a certified
/// path, and then moves from rest to rest along a joint line, or stays where it stopped:
/// docs/theory.md (14.24).
class FailSafe {
 public:
  explicit FailSafe(Eigen::Index dof);

  /// A stop, as StopMotion::set().
  void set_stop(const Eigen::VectorXd& q, const Eigen::VectorXd& v, const Eigen::VectorXd& a,
                const StopMotion::Braking& braking);
  /// A stop along a path, as PathStop::set().
  void set_path_stop(const CertifiedPath& path, const PathStop::Place& from,
                     const PathStop::Deviation& deviation, double braking,
                     const PathStop::Bounds& bounds);
  /// At rest from the start.
  void set_at_rest(const Eigen::VectorXd& q);
  /// After the stop, a move from rest to rest. @param duration_s above zero
  void set_move(const Eigen::VectorXd& target, double duration_s);
  void drop_move() noexcept { move_s_ = 0.0; }

  /// Whether the stop is along a path; else it is on a straight line.
  [[nodiscard]] bool along_path() const noexcept { return along_path_; }
  [[nodiscard]] const StopMotion& stop() const noexcept { return stop_; }
  [[nodiscard]] const PathStop& path_stop() const noexcept { return path_stop_; }
  /// Where the stop ends.
  [[nodiscard]] const Eigen::VectorXd& stop_end() const noexcept {
    return along_path_ ? path_stop_.end() : stop_.end();
  }
  [[nodiscard]] bool moves() const noexcept { return move_s_ > 0.0; }
  [[nodiscard]] double move_s() const noexcept { return move_s_; }
  /// The way of the move; not used without one.
  [[nodiscard]] const Eigen::VectorXd& way() const noexcept { return way_; }
  /// Where the motion ends.
  [[nodiscard]] const Eigen::VectorXd& end() const noexcept {
    return moves() ? target_ : stop_end();
  }
  [[nodiscard]] double stop_s() const noexcept {
    return along_path_ ? path_stop_.duration_s() : stop_.duration_s();
  }
  [[nodiscard]] double duration_s() const noexcept { return stop_s() + move_s_; }
  /// Position and velocity at a time from the start.
  void at(double time_s, Eigen::VectorXd& q, Eigen::VectorXd& v) const;

  /// Largest values of the move's velocity and acceleration, and a bound of its jerk, in units of
  /// its way per power of its duration.
  static constexpr double peak_velocity = 1.875, peak_acceleration = 5.7735027, peak_jerk = 60.0;
  /// Position, velocity and acceleration of the move at a share of its duration, in these units.
  struct Profile {
    double position, velocity, acceleration;
  };
  [[nodiscard]] static Profile profile(double share);

 private:
  StopMotion stop_;
  PathStop path_stop_;
  bool along_path_ = false;
  double move_s_ = 0.0;
  Eigen::VectorXd way_, target_;
};

}  // namespace hamelin::control

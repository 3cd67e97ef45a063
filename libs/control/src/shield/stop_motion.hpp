#pragma once
#include <Eigen/Core>

namespace hamelin::control {

/// A motion to rest: docs/theory.md (14.1)–(14.4). It begins at (q, v) with the acceleration a₀.
/// During the ramp t_r the acceleration changes linearly to −α w, where w = v + a₀ t_r/2, and from
/// then on the arm moves on the straight line along w: its velocity is s w, and s falls at the
/// constant rate α. During the last t_e the acceleration returns to zero linearly.
class StopMotion {
 public:
  explicit StopMotion(Eigen::Index dof);

  /// How the motion brakes.
  struct Braking {
    double rate = 0.0;    ///< α [1/s]
    double ramp_s = 0.0;  ///< t_r
    double fade_s = 0.0;  ///< t_e; α (t_r + t_e) ≤ 2
  };
  /// @param a initial acceleration, not used without a ramp
  void set(const Eigen::VectorXd& q, const Eigen::VectorXd& v, const Eigen::VectorXd& a,
           const Braking& braking);
  /// A motion that is at rest from the start.
  void set_at_rest(const Eigen::VectorXd& q);

  [[nodiscard]] const Eigen::VectorXd& start() const noexcept { return q_; }
  /// Where the line begins, and where the motion ends.
  [[nodiscard]] const Eigen::VectorXd& line_start() const noexcept { return q_line_; }
  [[nodiscard]] const Eigen::VectorXd& end() const noexcept { return q_end_; }
  /// The least and the largest position of joint j during the whole motion: within the ramp the
  /// joint may turn back, and on the line it moves one way.
  struct Range {
    double least, largest;
  };
  [[nodiscard]] Range range(Eigen::Index j) const;
  /// a₀ [rad/s² or m/s²].
  [[nodiscard]] const Eigen::VectorXd& acceleration() const noexcept { return a_; }
  /// w [rad/s or m/s].
  [[nodiscard]] const Eigen::VectorXd& line_velocity() const noexcept { return w_; }
  [[nodiscard]] const Braking& braking() const noexcept { return braking_; }
  [[nodiscard]] double duration_s() const noexcept { return duration_; }
  /// Position and velocity at a time from the start.
  void at(double time_s, Eigen::VectorXd& q, Eigen::VectorXd& v) const;

 private:
  Eigen::VectorXd q_, v_, a_, w_, q_line_, q_end_;
  Braking braking_;
  double speed_ = 0.0;     ///< s at the start of the line
  double steady_s_ = 0.0;  ///< time on the line before the fade
  double duration_ = 0.0;
};

}  // namespace hamelin::control

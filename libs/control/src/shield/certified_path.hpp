#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "hamelin/timing/time_law.hpp"
#include "hamelin/timing/timed_path.hpp"

namespace hamelin::control {

/// A timed motion that ends at rest, with what is proved of it: docs/theory.md (14.30). An interval
/// is that between two nodes of the motion.
struct CertifiedPath {
  timing::TimedPath motion;
  /// What the arm keeps at least from all that stands still, and its parts from each other, on each
  /// interval [m].
  Eigen::VectorXd clearance_m, self_m;
  /// How far each joint is from its limits on each interval, dof × intervals [rad or m]; of size
  /// zero: there are none.
  Eigen::MatrixXd room;
  timing::Limits limits;  ///< that it keeps
  /// What stops may use of accelerations [rad/s² or m/s²]; of size zero: no bound.
  Eigen::VectorXd stop_acceleration;
  /// The share of bounded rates that the motion uses; the rest is for stops and feedback.
  static constexpr double rate_share = 0.5;
  /// Where changes of torques or accelerations are bounded, the rate at which β may change [1/s²],
  /// and its bound at each node [1/s]: docs/theory.md (14.37). Else zero, and of size zero.
  double braking_ramp = 0.0;
  Eigen::VectorXd braking_max;
  /// The largest |M| on the path: bounds of torques per acceleration, dof × dof.
  Eigen::MatrixXd mass;
  std::uint64_t standing = 0;  ///< WorldSnapshot::standing of the world for which it is proved
};

/// A motion to rest along a certified path, from near it: docs/theory.md (14.31)–(14.33). Where
/// Γ(θ) is the path's own motion, the arm moves at Γ(θ(t)) + δ(t): the rate ρ = dθ/dt falls at the
/// rate β, which is constant or changes linearly between some places, and the deviation at the
/// beginning fades. No allocation after construction.
class PathStop {
 public:
  explicit PathStop(Eigen::Index dof);

  /// θ and ρ.
  using Place = timing::TimedPath::Place;
  /// What bounds the braking.
  struct Bounds {
    const Eigen::VectorXd& effort_max;  ///< that a stop may use [Nm or N]; of size zero: none
    double rate_max;                    ///< of ρ [1/s]
  };
  /// The deviation of an arm from the path, in position, velocity and, where that may not jump,
  /// acceleration.
  struct Deviation {
    const Eigen::VectorXd &e, &rate, &acceleration;
  };
  /// Sets the motion; the path must stay.
  /// @param braking β at the beginning, where it may not jump [1/s]
  void set(const CertifiedPath& path, const Place& from, const Deviation& deviation, double braking,
           const Bounds& bounds);
  void at(double time_s, Eigen::VectorXd& q, Eigen::VectorXd& v) const;
  /// The same without the deviation, with the acceleration.
  void path_at(double time_s, Eigen::VectorXd& q, Eigen::VectorXd& v, Eigen::VectorXd& a) const;

  [[nodiscard]] const CertifiedPath* path() const noexcept { return path_; }
  [[nodiscard]] const Eigen::VectorXd& end() const noexcept { return end_; }
  [[nodiscard]] double duration_s() const noexcept { return duration_s_; }
  /// The time after which ρ is zero.
  [[nodiscard]] double braking_s() const noexcept { return braking_s_; }
  /// The time in which β rises to its largest value; zero if it jumps [s].
  [[nodiscard]] double ramp_s() const noexcept { return ramp_s_; }
  /// Bound of |δ| per joint, at all times.
  [[nodiscard]] const Eigen::VectorXd& widest() const noexcept { return widest_; }
  /// Bound of the acceleration by which the deviation fades, of each joint.
  [[nodiscard]] const Eigen::VectorXd& fade_acceleration() const noexcept { return fade_; }
  /// The first and the last interval that it passes.
  [[nodiscard]] Eigen::Index first() const noexcept { return first_; }
  [[nodiscard]] Eigen::Index last() const noexcept { return last_; }
  static constexpr double fade_rate = 25.0;  ///< ω [1/s]

 private:
  void set_deviation(const Deviation& deviation, bool jumps);
  void brake(const Place& from);
  void brake_with_ramps(const Place& from, double braking);
  /// Sets bound_ at the nodes that the stop may pass, given upper bounds of ρ² there.
  void set_bounds(double rate, Eigen::Index end);
  void follow_bounds(const Place& from, double braking, Eigen::Index end);
  /// From a time on, until the next piece: θ, ρ, β and its rate of change.
  struct Piece {
    double time_s, theta_s, rate, braking, slope;
  };
  /// θ, ρ and β on a piece, so long after its beginning.
  [[nodiscard]] static Piece ahead(const Piece& piece, double dt);
  [[nodiscard]] Piece place_at(double time_s) const;
  /// The largest β of an interval that torques and accelerations allow, where ρ² is that at
  /// `theta_s`.
  [[nodiscard]] double allowed(Eigen::Index interval, double theta_s, double square) const;
  /// Lowers a bound of β by the limits at a node, ahead by so much.
  void bound_by(Eigen::Index node, double u, double square, double ahead_s, double& most) const;

  const CertifiedPath* path_ = nullptr;
  std::vector<Piece> pieces_;
  double rate_max_ = 0.0, braking_s_ = 0.0, duration_s_ = 0.0;
  double ramp_s_ = 0.0;
  Eigen::VectorXd e_, slope_, bend_, widest_, fade_, end_, effort_, acceleration_;
  Eigen::VectorXd square_, bound_;  ///< bounds of ρ² and β at each node
  mutable Eigen::VectorXd v_, a_;
  mutable timing::TimedPath::Cursor cursor_;
  Eigen::Index first_ = 0, last_ = 0;
};

}  // namespace hamelin::control

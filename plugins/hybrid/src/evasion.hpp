#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace hamelin::hybrid {

/// Configurations that the arm came along, at least `spacing` apart; the oldest are forgotten.
class Trail {
 public:
  static constexpr double spacing = 0.04, reached = 0.1;  ///< [rad or m]
  Trail(Eigen::Index dof, Eigen::Index capacity) : points_(dof, capacity) {}

  void clear() noexcept { size_ = 0; }
  /// The point that was added `age` points before the newest.
  [[nodiscard]] auto point(Eigen::Index age) const {
    return points_.col((newest_ - age + points_.cols()) % points_.cols());
  }
  /// Adds q if it is far enough from the newest point.
  void add(const Eigen::VectorXd& q) {
    if (size_ > 0 && (point(0) - q).norm() < spacing) return;
    newest_ = (newest_ + 1) % points_.cols();
    points_.col(newest_) = q;
    size_ = std::min(size_ + 1, points_.cols());
  }
  [[nodiscard]] Eigen::Index size() const noexcept { return size_; }
  /// Skips points that q has reached on the way back, from `age` on. The oldest one is kept.
  [[nodiscard]] Eigen::Index next(Eigen::Index age, const Eigen::VectorXd& q) const {
    while (age + 1 < size_ && (point(age) - q).norm() < reached) ++age;
    return age;
  }
  /// Takes the newest points of another trail, as many as it has room for.
  void copy(const Trail& other) {
    size_ = std::min(other.size_, points_.cols());
    newest_ = points_.cols() - 1;
    for (Eigen::Index age = 0; age < size_; ++age) points_.col(newest_ - age) = other.point(age);
  }
  /// Forgets the newest points.
  void forget(Eigen::Index count) {
    newest_ = (newest_ - count + points_.cols()) % points_.cols();
    size_ -= count;
  }

 private:
  Eigen::MatrixXd points_;  ///< a ring, one column per point
  Eigen::Index newest_ = 0, size_ = 0;
};

/// What the arm does about moving obstacles: it goes its own way, stops, goes back along its trail,
/// or moves towards a configuration.
enum class Act { own, stop, back, aside };

struct Evasion {
  explicit Evasion(Eigen::Index dof) : aside(Eigen::VectorXd::Zero(dof)) {}
  Act act = Act::own;
  bool rows = true;       ///< whether the rows of moving obstacles act
  bool clear = true;      ///< whether it was found to stay clear
  Eigen::VectorXd aside;  ///< where Act::aside leads
};

/// Gain and acceleration with which the arm follows an evasion [1/s, rad/s²].
inline constexpr double evasion_gain = 20.0, evasion_acceleration = 8.0;

/// Sets u to the velocity that an evasion wants at q, docs/theory.md (10.37); not for Act::own.
/// @param age of the trail's point that it heads for; moves on
inline void evasion_velocity(const Evasion& evasion, const Trail& trail, const Eigen::VectorXd& q,
                             Eigen::Index& age, Eigen::VectorXd& u) {
  constexpr double speed = 2.0, gain = 4.0, slow_within = 0.02;
  u.setZero();
  if (evasion.act == Act::aside) {
    u = evasion.aside - q;
    u *= std::min(gain, speed / std::max(u.norm(), 1e-9));
  } else if (evasion.act == Act::back && trail.size() > 0) {
    age = trail.next(age, q);
    u = trail.point(age) - q;
    const double far = u.norm();
    u *= age + 1 < trail.size() ? speed / std::max(far, slow_within)
                                : std::min(gain, speed / std::max(far, 1e-9));
  }
}

}  // namespace hamelin::hybrid

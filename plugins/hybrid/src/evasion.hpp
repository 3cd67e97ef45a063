#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "hamelin/planning/trail.hpp"

namespace hamelin::hybrid {

using planning::Trail;

/// Of the trail along which the arm goes back [rad or m]: distance between its points, and that at
/// which one is reached.
inline constexpr double trail_spacing = 0.04, trail_reached = 0.1;

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
    age = trail.next(age, q, trail_reached);
    u = trail.point(age) - q;
    const double far = u.norm();
    u *= age + 1 < trail.size() ? speed / std::max(far, slow_within)
                                : std::min(gain, speed / std::max(far, 1e-9));
  }
}

}  // namespace hamelin::hybrid

#pragma once
#include <Eigen/Core>

namespace hamelin::mppi {

/// The longest step from which steps that shorten by `change` each come to rest within the distance
/// x: d + (d − b) + (d − 2b) + … = x, docs/theory.md (15.4). It is concave in x. For arrays.
template <class Array>
[[nodiscard]] Array braking_step(const Array& x, double change) {
  const Array room = x.max(0.0);
  const Array shorter = (0.5 * ((1.0 + 8.0 / change * room).sqrt() - 1.0)).floor();
  return (room + 0.5 * change * shorter * (shorter + 1.0)) / (shorter + 1.0);
}

/// Limits of the differences of control points, which bound velocity and acceleration of the whole
/// spline: docs/theory.md (15.3). Per joint.
struct StepLimits {
  Eigen::VectorXd speed;         ///< of a first difference [rad or m]
  Eigen::VectorXd change;        ///< of a second difference [rad or m]
  Eigen::VectorXd lower, upper;  ///< of the control points [rad or m]; infinite where unlimited

  /// The admissible step nearest to a desired one: within the speed, with room to brake before the
  /// position limits and until the end of the horizon, docs/theory.md (15.4). The bound of the
  /// second difference goes last, so that it always holds. For arrays of one number per lane.
  /// @param position the control point before, previous the step before
  /// @param steps_left the number of steps after this one that may differ from zero
  template <class Array>
  [[nodiscard]] Array limit(Eigen::Index joint, const Array& desired, const Array& position,
                            const Array& previous, double steps_left) const {
    const double b = change[joint], c = std::min(speed[joint], b * (steps_left + 1.0));
    const Array above = upper[joint] - position, below = position - lower[joint];
    Array d = desired.min(c).max(-c);
    d = d.min(braking_step<Array>(above, b)).max(-braking_step<Array>(below, b));
    return d.min(previous + b).max(previous - b);
  }
};

}  // namespace hamelin::mppi

#pragma once
#include <Eigen/Core>

#include "hamelin/geometry/se3.hpp"

namespace hamelin::search {

/// A curve of poses of a tip over s from 0 to 1: a line or an arc of a circle at constant speed,
/// with a rotation about one axis at constant rate. docs/theory.md (21.4)
class TipCurve {
 public:
  [[nodiscard]] static TipCurve line(const geometry::SE3& from, const geometry::SE3& to);
  /// @throws Error invalid if the three points are on a line, to within a millionth of its length
  [[nodiscard]] static TipCurve arc(const geometry::SE3& from, const Eigen::Vector3d& through_m,
                                    const geometry::SE3& to);

  [[nodiscard]] geometry::SE3 at(double s) const;
  /// Where the curve is nearest to a pose: its point, or its rotation where it only turns.
  [[nodiscard]] double nearest(const geometry::SE3& tip) const;
  [[nodiscard]] double length_m() const noexcept { return length_; }
  /// The angle by which the tip turns [rad].
  [[nodiscard]] double turn_rad() const noexcept { return turn_; }
  /// Of the second derivative of the point by s [m].
  [[nodiscard]] double bend_m() const noexcept { return radius_ * angle_ * angle_; }

 private:
  Eigen::Matrix3d from_R_, frame_;         ///< at s = 0; of an arc, x to its first point
  Eigen::Vector3d from_p_, along_, axis_;  ///< axis_: of the rotation, in the tip's frame
  Eigen::Vector3d center_;
  double radius_ = 0.0, angle_ = 0.0;  ///< of an arc; zero for a line
  double length_ = 0.0, turn_ = 0.0;
};

}  // namespace hamelin::search

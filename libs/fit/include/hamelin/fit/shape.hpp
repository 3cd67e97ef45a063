#pragma once
#include <Eigen/Core>
#include <algorithm>

namespace hamelin::fit {

/// All points within a radius of a segment: a capsule, or a ball if both ends are the same. In the
/// frame of a link [m].
struct Shape {
  Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = Eigen::Vector3d::Zero();
  double radius_m = 0.0;

  [[nodiscard]] bool ball() const { return from == to; }
};

/// Distance of p from the segment [m].
[[nodiscard]] inline double segment_distance(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                                             const Eigen::Vector3d& p) {
  const Eigen::Vector3d along = to - from, out = p - from;
  const double square = along.squaredNorm();
  const double t = square > 0.0 ? std::clamp(out.dot(along) / square, 0.0, 1.0) : 0.0;
  return (out - t * along).norm();
}

/// Distance of p from the shape's surface [m], negative inside. A convex function of p.
[[nodiscard]] inline double distance(const Shape& shape, const Eigen::Vector3d& p) {
  return segment_distance(shape.from, shape.to, p) - shape.radius_m;
}

}  // namespace hamelin::fit

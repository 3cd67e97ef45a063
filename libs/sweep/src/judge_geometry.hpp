#pragma once
#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "hamelin/core/numbers.hpp"
#include "hamelin/scene/scene.hpp"

/// Geometry that the judge's arm and map share.
namespace hamelin::sweep {

[[nodiscard]] inline Eigen::Isometry3d isometry(const geometry::SE3& g) {
  Eigen::Isometry3d made = Eigen::Isometry3d::Identity();
  made.linear() = g.R();
  made.translation() = g.p();
  return made;
}

[[nodiscard]] inline double distance_from_box(const scene::Box& box, const Eigen::Vector3d& p) {
  return (box.lo - p).cwiseMax(p - box.hi).cwiseMax(0.0).norm();
}

[[nodiscard]] inline double distance_from_boxes(const std::vector<scene::Box>& boxes,
                                                const Eigen::Vector3d& p) {
  double nearest = infinity;
  for (const auto& box : boxes)
    nearest = std::min(nearest, (box.lo - p).cwiseMax(p - box.hi).cwiseMax(0.0).squaredNorm());
  return std::sqrt(nearest);
}

}  // namespace hamelin::sweep

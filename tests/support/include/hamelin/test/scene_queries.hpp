#pragma once
#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "hamelin/core/rng.hpp"
#include "hamelin/scene/boxes.hpp"

namespace hamelin::test {

/// A random unit vector, uniform on the sphere.
inline Eigen::Vector3d random_direction(Rng& rng) {
  for (;;) {
    const Eigen::Vector3d v{rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0)};
    const double norm = v.norm();
    if (norm > 0.01 && norm <= 1.0) return v / norm;
  }
}

/// The distance from a point to a union of boxes, by visiting all of them; zero inside.
inline double brute_force_distance(const std::vector<scene::Box>& boxes, const Eigen::Vector3d& p) {
  double best = std::numeric_limits<double>::infinity();
  for (const scene::Box& box : boxes) {
    double sum = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
      const double nearest = std::fmin(std::fmax(p[axis], box.lo[axis]), box.hi[axis]);
      sum += (p[axis] - nearest) * (p[axis] - nearest);
    }
    best = std::fmin(best, sum);
  }
  return std::sqrt(best);
}

/// Random points within `reach` of the boxes: points of random boxes, displaced in random
/// directions. Some of them lie inside a box.
inline std::vector<Eigen::Vector3d> points_near(const std::vector<scene::Box>& boxes,
                                                std::size_t count, double reach,
                                                std::uint64_t seed) {
  Rng rng(seed);
  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < count; ++i) {
    const scene::Box& box = boxes[rng.below(boxes.size())];
    Eigen::Vector3d p;
    for (int axis = 0; axis < 3; ++axis) p[axis] = rng.uniform(box.lo[axis], box.hi[axis]);
    points.push_back(p + rng.uniform(0.0, reach) * random_direction(rng));
  }
  return points;
}

}  // namespace hamelin::test

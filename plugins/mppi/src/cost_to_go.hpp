#pragma once
#include <algorithm>
#include <cmath>
#include <limits>

#include "hamelin/planning/joint_path.hpp"

namespace hamelin::mppi {

struct PathPlace {
  double cost;  ///< length to go [rad or m]
  double s;     ///< where the path is joined
};

/// The least of (L − s) + κ |q − p(s)| over the arc lengths s from `from` to `to`, in closed form
/// for each segment: docs/theory.md (15.7). A path without length is a goal to which no path is
/// known.
template <class Vector>
[[nodiscard]] PathPlace cost_to_go(const planning::JointPath& path, const Vector& q, double from,
                                   double to) {
  constexpr double deviation_weight = 3.0;      // κ
  constexpr double lead = 0.35355339059327373;  // 1/√(κ² − 1)
  if (path.length() == 0.0) return {(path.point(0) - q).norm(), 0.0};
  PathPlace best{std::numeric_limits<double>::infinity(), from};
  for (Eigen::Index i = 0; i + 1 < path.size(); ++i) {
    if (path.arc(i + 1) < from && i + 2 < path.size()) continue;
    if (path.arc(i) > to) break;
    const double segment = path.arc(i + 1) - path.arc(i);
    if (segment <= 0.0) continue;
    const auto direction = (path.point(i + 1) - path.point(i)) / segment;
    const double along = direction.dot(q - path.point(i));
    const double off = std::sqrt(std::max(0.0, (q - path.point(i)).squaredNorm() - along * along));
    const double low = std::clamp(from - path.arc(i), 0.0, segment),
                 high = std::clamp(to - path.arc(i), low, segment);
    const double t = std::clamp(along + off * lead, low, high);
    const double cost =
        path.length() - path.arc(i) - t + deviation_weight * std::hypot(off, along - t);
    if (cost < best.cost) best = {cost, path.arc(i) + t};
  }
  return best;
}

}  // namespace hamelin::mppi

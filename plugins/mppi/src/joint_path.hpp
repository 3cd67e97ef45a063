#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace hamelin::mppi {

/// A polyline of joint vectors that guides rollouts, with a cost to go for any place near it. A
/// path of one point is a goal to which no path is known. The memory is allocated once.
class JointPath {
 public:
  JointPath(Eigen::Index dof, Eigen::Index capacity)
      : points_(Eigen::MatrixXd::Zero(dof, capacity)),
        arc_(to_size(capacity)),
        turn_(to_size(capacity)) {}

  void clear() noexcept { size_ = 0; }
  [[nodiscard]] Eigen::Index size() const noexcept { return size_; }
  [[nodiscard]] auto end() const { return points_.col(size_ - 1); }
  [[nodiscard]] double length() const noexcept { return size_ == 0 ? 0.0 : arc(size_ - 1); }
  [[nodiscard]] double arc(Eigen::Index i) const { return arc_[to_size(i)]; }
  /// Appends a point; does nothing if the capacity is used up.
  template <class Point>
  void add(const Point& q) {
    if (size_ == points_.cols()) return;
    points_.col(size_) = q;
    arc_[to_size(size_)] =
        size_ == 0 ? 0.0 : arc(size_ - 1) + (points_.col(size_) - points_.col(size_ - 1)).norm();
    turn_[to_size(size_)] = 0.0;
    if (++size_ > 2) measure_turn(size_ - 2);
  }
  /// How sharply the path turns at a point: the difference of the directions before and behind it.
  [[nodiscard]] double turn(Eigen::Index i) const { return turn_[to_size(i)]; }
  /// The point at the arc length s.
  void at(double s, Eigen::Ref<Eigen::VectorXd> out) const {
    Eigen::Index i = 0;
    while (i + 1 < size_ && arc(i + 1) < s) ++i;
    if (i + 1 >= size_) {
      out = end();
      return;
    }
    const double segment = arc(i + 1) - arc(i);
    const double t = segment > 0.0 ? std::clamp((s - arc(i)) / segment, 0.0, 1.0) : 0.0;
    out = (1.0 - t) * points_.col(i) + t * points_.col(i + 1);
  }

  struct Place {
    double cost;  ///< length to go [rad or m]
    double s;     ///< where the path is joined
  };
  /// The least of (L − s) + κ |q − p(s)| over the arc lengths s from `from` to `to`, in closed form
  /// for each segment: docs/theory.md (15.7).
  template <class Vector>
  [[nodiscard]] Place cost_to_go(const Vector& q, double from, double to) const {
    if (length() == 0.0) return {(points_.col(0) - q).norm(), 0.0};
    Place best{std::numeric_limits<double>::infinity(), from};
    for (Eigen::Index i = 0; i + 1 < size_; ++i) {
      if (arc(i + 1) < from && i + 2 < size_) continue;
      if (arc(i) > to) break;
      const double segment = arc(i + 1) - arc(i);
      if (segment <= 0.0) continue;
      const auto direction = (points_.col(i + 1) - points_.col(i)) / segment;
      const double along = direction.dot(q - points_.col(i));
      const double off =
          std::sqrt(std::max(0.0, (q - points_.col(i)).squaredNorm() - along * along));
      const double low = std::clamp(from - arc(i), 0.0, segment),
                   high = std::clamp(to - arc(i), low, segment);
      const double t = std::clamp(along + off * lead, low, high);
      const double cost = length() - arc(i) - t + deviation_weight * std::hypot(off, along - t);
      if (cost < best.cost) best = {cost, arc(i) + t};
    }
    return best;
  }

 private:
  static constexpr double deviation_weight = 3.0;      // κ
  static constexpr double lead = 0.35355339059327373;  // 1/√(κ² − 1)
  static std::size_t to_size(Eigen::Index n) { return static_cast<std::size_t>(n); }

  void measure_turn(Eigen::Index i) {
    const double before = arc(i) - arc(i - 1), behind = arc(i + 1) - arc(i);
    if (before > 0.0 && behind > 0.0)
      turn_[to_size(i)] = ((points_.col(i) - points_.col(i - 1)) / before -
                           (points_.col(i + 1) - points_.col(i)) / behind)
                              .norm();
  }

  Eigen::MatrixXd points_;
  std::vector<double> arc_, turn_;
  Eigen::Index size_ = 0;
};

}  // namespace hamelin::mppi

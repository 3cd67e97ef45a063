#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <vector>

namespace hamelin::planning {

/// A polyline in joint space. A place on it is given by its arc length from the start [rad or m].
/// The memory for its points is allocated once.
class JointPath {
 public:
  JointPath(Eigen::Index dof, Eigen::Index capacity)
      : points_(Eigen::MatrixXd::Zero(dof, capacity)) {
    arc_.reserve(static_cast<std::size_t>(capacity));
  }

  void clear() noexcept { arc_.clear(); }
  [[nodiscard]] bool empty() const noexcept { return arc_.empty(); }
  [[nodiscard]] Eigen::Index size() const noexcept {
    return static_cast<Eigen::Index>(arc_.size());
  }
  [[nodiscard]] Eigen::Index capacity() const noexcept { return points_.cols(); }
  [[nodiscard]] double length() const noexcept { return empty() ? 0.0 : arc_.back(); }
  /// The arc length of a point.
  [[nodiscard]] double arc(Eigen::Index i) const { return arc_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] auto point(Eigen::Index i) const { return points_.col(i); }
  [[nodiscard]] auto end() const { return points_.col(size() - 1); }
  /// Appends a point. Does nothing if the capacity is used up.
  template <class Point>
  void add(const Point& q) {
    if (size() == capacity()) return;
    points_.col(size()) = q;
    const double segment = empty() ? 0.0 : (points_.col(size()) - points_.col(size() - 1)).norm();
    arc_.push_back(length() + segment);
  }
  /// How sharply the path turns at a point: the difference of the directions before and behind it.
  [[nodiscard]] double turn(Eigen::Index i) const {
    if (i == 0 || i + 1 >= size()) return 0.0;
    const double before = arc(i) - arc(i - 1), behind = arc(i + 1) - arc(i);
    if (!(before > 0.0 && behind > 0.0)) return 0.0;
    return ((points_.col(i) - points_.col(i - 1)) / before -
            (points_.col(i + 1) - points_.col(i)) / behind)
        .norm();
  }
  /// The point at arc length s.
  void at(double s, Eigen::Ref<Eigen::VectorXd> out) const {
    const auto next = std::upper_bound(arc_.begin(), arc_.end(), s);
    if (next == arc_.begin()) {
      out = points_.col(0);
    } else if (next == arc_.end()) {
      out = end();
    } else {
      const auto i = static_cast<Eigen::Index>(next - arc_.begin());
      const double from = *(next - 1), segment = *next - from,
                   t = segment > 0.0 ? (s - from) / segment : 0.0;
      out = (1.0 - t) * points_.col(i - 1) + t * points_.col(i);
    }
  }
  /// Finds the first place from s on that lies at least `ahead` from q, searching in steps of 0.02.
  /// @param out the point there
  /// @return its arc length; that of the end if there is no such place
  template <class Position>
  [[nodiscard]] double carrot(double s, const Position& q, double ahead,
                              Eigen::VectorXd& out) const {
    constexpr double step = 0.02;
    at(s, out);
    while (s < length() && (out - q).norm() < ahead) {
      s = std::min(s + step, length());
      at(s, out);
    }
    return s;
  }

 private:
  Eigen::MatrixXd points_;   ///< one column per point
  std::vector<double> arc_;  ///< of each point
};

}  // namespace hamelin::planning

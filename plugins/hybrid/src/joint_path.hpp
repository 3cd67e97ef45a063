#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <vector>

namespace hamelin::hybrid {

/// A polyline in joint space. A place on it is given by its arc length from the start [rad or m].
/// The memory for its points is allocated once.
class JointPath {
 public:
  JointPath(Eigen::Index dof, Eigen::Index capacity) : points_(dof, capacity) {
    arc_lengths_.reserve(to_size(capacity));
  }

  void clear() noexcept { arc_lengths_.clear(); }
  [[nodiscard]] bool empty() const noexcept { return arc_lengths_.empty(); }
  [[nodiscard]] Eigen::Index size() const noexcept {
    return static_cast<Eigen::Index>(arc_lengths_.size());
  }
  [[nodiscard]] Eigen::Index capacity() const noexcept { return points_.cols(); }
  [[nodiscard]] double length() const noexcept { return empty() ? 0.0 : arc_lengths_.back(); }
  [[nodiscard]] auto point(Eigen::Index i) const { return points_.col(i); }
  [[nodiscard]] auto end() const { return points_.col(size() - 1); }
  /// Appends a point. Does nothing if the capacity is used up.
  template <class Point>
  void add(const Point& q) {
    if (size() == capacity()) return;
    points_.col(size()) = q;
    const double segment = empty() ? 0.0 : (points_.col(size()) - points_.col(size() - 1)).norm();
    arc_lengths_.push_back(length() + segment);
  }
  /// The point at arc length s.
  void at(double s, Eigen::VectorXd& out) const {
    const auto next = std::upper_bound(arc_lengths_.begin(), arc_lengths_.end(), s);
    if (next == arc_lengths_.begin()) {
      out = points_.col(0);
    } else if (next == arc_lengths_.end()) {
      out = end();
    } else {
      const auto i = static_cast<Eigen::Index>(next - arc_lengths_.begin());
      const double from = *(next - 1), segment = *next - from,
                   t = segment > 0.0 ? (s - from) / segment : 0.0;
      out = (1.0 - t) * points_.col(i - 1) + t * points_.col(i);
    }
  }
  /// Finds the first place from s on that lies at least `ahead` from q, searching in steps of 0.02.
  /// @param out the point there
  /// @return its arc length; that of the end if there is no such place
  [[nodiscard]] double carrot(double s, const Eigen::VectorXd& q, double ahead,
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
  static std::size_t to_size(Eigen::Index n) { return static_cast<std::size_t>(n); }

  Eigen::MatrixXd points_;  ///< one column per point
  std::vector<double> arc_lengths_;
};

}  // namespace hamelin::hybrid

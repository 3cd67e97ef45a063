#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <limits>
#include <vector>

namespace hamelin::hybrid {

/// A polyline in joint space, measured by its length from the start [rad or m]. Room for its points is taken once.
class Way {
 public:
  Way(Eigen::Index dof, Eigen::Index capacity) : points_(dof, capacity) { along_.reserve(capacity_of(capacity)); }

  void clear() noexcept { along_.clear(); }
  [[nodiscard]] bool empty() const noexcept { return along_.empty(); }
  [[nodiscard]] Eigen::Index size() const noexcept { return static_cast<Eigen::Index>(along_.size()); }
  [[nodiscard]] Eigen::Index capacity() const noexcept { return points_.cols(); }
  [[nodiscard]] double length() const noexcept { return empty() ? 0.0 : along_.back(); }
  [[nodiscard]] auto point(Eigen::Index i) const { return points_.col(i); }
  [[nodiscard]] auto end() const { return points_.col(size() - 1); }
  /// Adds a point at the end; nothing once the room is used up.
  template <class Point>
  void add(const Point& q) {
    if (size() == capacity()) return;
    points_.col(size()) = q;
    const double hop = empty() ? 0.0 : (points_.col(size()) - points_.col(size() - 1)).norm();
    along_.push_back(length() + hop);
  }
  /// Leaves only the first n points.
  void keep(Eigen::Index n) { along_.resize(capacity_of(std::min(n, size()))); }
  void reverse() {
    const auto n = size();
    for (Eigen::Index i = 0; i < n / 2; ++i) points_.col(i).swap(points_.col(n - 1 - i));
    measure(n);
  }
  /// The point at length s.
  void at(double s, Eigen::VectorXd& out) const {
    const auto next = std::upper_bound(along_.begin(), along_.end(), s);
    if (next == along_.begin()) {
      out = points_.col(0);
    } else if (next == along_.end()) {
      out = end();
    } else {
      const auto i = static_cast<Eigen::Index>(next - along_.begin());
      const double from = *(next - 1), hop = *next - from, t = hop > 0.0 ? (s - from) / hop : 0.0;
      out = (1.0 - t) * points_.col(i - 1) + t * points_.col(i);
    }
  }
  /// The first length from s on whose point is at least `ahead` from q, in steps; the end if there is none.
  [[nodiscard]] double carrot(double s, const Eigen::VectorXd& q, double ahead, Eigen::VectorXd& out) const {
    constexpr double step = 0.02;
    at(s, out);
    while (s < length() && (out - q).norm() < ahead) {
      s = std::min(s + step, length());
      at(s, out);
    }
    return s;
  }
  /// The length between s and s + range whose point is nearest to q.
  [[nodiscard]] double nearest(double s, double range, const Eigen::VectorXd& q, Eigen::VectorXd& scratch) const {
    constexpr double step = 0.02;
    double best = s, least = std::numeric_limits<double>::infinity();
    for (double at_s = s; at_s <= std::min(s + range, length()); at_s += step) {
      at(at_s, scratch);
      if (const double far = (scratch - q).squaredNorm(); far < least) least = far, best = at_s;
    }
    return best;
  }
  /// Replaces what lies between the lengths a < b by a straight line.
  void cut(double a, double b, Eigen::VectorXd& from, Eigen::VectorXd& to) {
    at(a, from);
    at(b, to);
    const auto first = std::upper_bound(along_.begin(), along_.end(), a) - along_.begin();  // first point past a
    const auto last = std::lower_bound(along_.begin(), along_.end(), b) - along_.begin();   // first point not before b
    const auto n = size(), grown = n - (last - first) + 2;
    if (grown > capacity()) return;
    const auto tail = n - last;
    if (first + 2 <= last) {
      for (Eigen::Index i = 0; i < tail; ++i) points_.col(first + 2 + i) = points_.col(last + i);
    } else {
      for (Eigen::Index i = tail - 1; i >= 0; --i) points_.col(first + 2 + i) = points_.col(last + i);
    }
    points_.col(first) = from;
    points_.col(first + 1) = to;
    measure(grown);
  }

 private:
  static std::size_t capacity_of(Eigen::Index n) { return static_cast<std::size_t>(n); }
  void measure(Eigen::Index n) {
    along_.clear();
    double s = 0.0;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (i > 0) s += (points_.col(i) - points_.col(i - 1)).norm();
      along_.push_back(s);
    }
  }

  Eigen::MatrixXd points_;  ///< one column a point
  std::vector<double> along_;
};

}  // namespace hamelin::hybrid

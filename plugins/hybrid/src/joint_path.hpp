#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <limits>
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
  /// Keeps only the first n points.
  void keep(Eigen::Index n) { arc_lengths_.resize(to_size(std::min(n, size()))); }
  void reverse() {
    const auto n = size();
    for (Eigen::Index i = 0; i < n / 2; ++i) points_.col(i).swap(points_.col(n - 1 - i));
    measure(n);
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
  /// The arc length between s and s + range at which the path is nearest to q.
  [[nodiscard]] double nearest(double s, double range, const Eigen::VectorXd& q,
                               Eigen::VectorXd& scratch) const {
    constexpr double step = 0.02;
    double best = s, least = std::numeric_limits<double>::infinity();
    for (double arc_length = s; arc_length <= std::min(s + range, length()); arc_length += step) {
      at(arc_length, scratch);
      if (const double distance = (scratch - q).squaredNorm(); distance < least)
        least = distance, best = arc_length;
    }
    return best;
  }
  /// Replaces the stretch between the arc lengths a < b by a straight line.
  void cut(double a, double b, Eigen::VectorXd& from, Eigen::VectorXd& to) {
    at(a, from);
    at(b, to);
    const auto begin = arc_lengths_.begin(), stop = arc_lengths_.end();
    const auto first = std::upper_bound(begin, stop, a) - begin;  // first point past a
    const auto last = std::lower_bound(begin, stop, b) - begin;   // first point not before b
    const auto n = size(), grown = n - (last - first) + 2;
    if (grown > capacity()) return;
    const auto tail = n - last;
    if (first + 2 <= last) {
      for (Eigen::Index i = 0; i < tail; ++i) points_.col(first + 2 + i) = points_.col(last + i);
    } else {
      for (Eigen::Index i = tail - 1; i >= 0; --i)
        points_.col(first + 2 + i) = points_.col(last + i);
    }
    points_.col(first) = from;
    points_.col(first + 1) = to;
    measure(grown);
  }

 private:
  static std::size_t to_size(Eigen::Index n) { return static_cast<std::size_t>(n); }
  void measure(Eigen::Index n) {
    arc_lengths_.clear();
    double s = 0.0;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (i > 0) s += (points_.col(i) - points_.col(i - 1)).norm();
      arc_lengths_.push_back(s);
    }
  }

  Eigen::MatrixXd points_;  ///< one column per point
  std::vector<double> arc_lengths_;
};

}  // namespace hamelin::hybrid

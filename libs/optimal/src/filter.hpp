#pragma once
#include <cmath>
#include <vector>

namespace hamelin::optimal {

/// Which steps of a line search are accepted: those that decrease the cost or the violation enough,
/// compared with the present iterate and with all iterates in the filter. docs/theory.md (18.12);
/// A. Wächter, L. T. Biegler, Mathematical Programming 106, 2006, section 2.3.
class Filter {
 public:
  struct Point {
    double violation, cost;
  };
  /// Empties the filter, for another cost. @param violation_scale of points with much violation
  void reset(double violation_scale) {
    points_.clear();
    scale_ = violation_scale;
  }
  /// @param slope of the cost along the step  @param step its length as a share of the full step
  /// @return whether the step from `now` to `next` is accepted; `now` may enter the filter
  bool accept(const Point& now, const Point& next, double slope, double step) {
    const double rounding = 1e-13 * std::abs(now.cost);
    if (!std::isfinite(next.cost) || !(next.violation <= largest * scale_)) return false;
    for (const Point& point : points_)
      if (!improves(point, next, rounding)) return false;
    // a step that promises more cost than it has violation must keep the promise
    const bool promising =
        slope < 0.0 && step * std::pow(-slope, 2.3) > std::pow(now.violation, 1.1);
    const bool decreases = next.cost <= now.cost + 1e-4 * step * slope + rounding;
    if (promising && now.violation <= small * scale_) return decreases;
    if (!improves(now, next, rounding)) return false;
    if (!promising || !decreases) points_.push_back(now);
    return true;
  }

 private:
  static constexpr double share = 1e-5, largest = 1e4, small = 1e-4;
  static bool improves(const Point& from, const Point& to, double rounding) {
    return to.violation <= (1.0 - share) * from.violation ||
           to.cost <= from.cost - share * from.violation + rounding;
  }

  std::vector<Point> points_;
  double scale_ = 1.0;
};

}  // namespace hamelin::optimal

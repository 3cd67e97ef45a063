#pragma once
#include <algorithm>
#include <cmath>

#include "filter.hpp"

namespace hamelin::optimal {

/// Which steps of a line search are accepted: those that decrease cost + ν violation enough, with a
/// penalty ν for which the step is a descent. It takes more steps than a Filter near bounds that
/// bend, but gets over more kinks. Nocedal, Wright, Numerical Optimization, section 18.3.
class Merit {
 public:
  using Point = Filter::Point;
  /// @param slope of the cost along the step
  void begin(const Point& from, double slope) {
    if (from.violation > 1e-14)
      if (const double needed = 2.0 * slope / from.violation; penalty_ < needed)
        penalty_ = 2.0 * needed;
    slope_ = slope - penalty_ * from.violation;
  }
  [[nodiscard]] double of(const Point& point) const {
    return point.cost + penalty_ * point.violation;
  }
  /// @param step its length as a share of the full step
  [[nodiscard]] bool accept(const Point& from, const Point& to, double step) const {
    return of(to) <= of(from) + 1e-4 * step * slope_ + 1e-13 * std::abs(of(from));
  }

 private:
  double penalty_ = 1.0, slope_ = 0.0;
};

}  // namespace hamelin::optimal

#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

namespace hamelin::integration {

/// Whether all numbers are finite; without a branch inside, for it runs once in every step.
[[nodiscard]] inline bool all_finite(const Eigen::VectorXd& x) noexcept {
  bool finite = true;
  for (Eigen::Index i = 0; i < x.size(); ++i) finite &= std::abs(x[i]) <= std::numeric_limits<double>::max();
  return finite;
}

/// ‖x‖∞, and NaN where any number is NaN (Eigen's norm may drop it).
[[nodiscard]] inline double largest_size(const Eigen::VectorXd& x) noexcept {
  double largest = 0.0;
  bool any_nan = false;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    largest = std::max(largest, std::abs(x[i]));  // passes NaN by
    any_nan |= std::isnan(x[i]);
  }
  return any_nan ? std::numeric_limits<double>::quiet_NaN() : largest;
}

}  // namespace hamelin::integration

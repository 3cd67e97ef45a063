#pragma once
#include <Eigen/Core>
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
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double size = std::abs(x[i]);
    if (size > largest || std::isnan(size)) largest = size;
  }
  return largest;
}

}  // namespace hamelin::integration

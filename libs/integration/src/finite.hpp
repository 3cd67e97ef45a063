#pragma once
#include <Eigen/Core>
#include <limits>

namespace hamelin::integration {

/// Whether all numbers are finite: 0 x is 0 for a finite x and NaN otherwise. Every step calls
/// this, so it is written as a sum, which the compiler vectorises.
template <class Vector>
[[nodiscard]] bool all_finite(const Eigen::MatrixBase<Vector>& x) noexcept {
  return (0.0 * x).sum() == 0.0;
}

/// ‖x‖∞, or NaN if a number is not finite (Eigen's norm may drop a NaN).
[[nodiscard]] inline double largest_size(const Eigen::VectorXd& x) noexcept {
  return all_finite(x) ? x.lpNorm<Eigen::Infinity>() : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace hamelin::integration

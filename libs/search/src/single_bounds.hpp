#pragma once

namespace hamelin::search {

inline constexpr double inflation = 1.0 + 1e-5;  ///< above what rounding to float can take

/// An upper bound of x ≥ 0 in single precision.
[[nodiscard]] inline float inflated(double x) {
  return static_cast<float>(x * inflation);
}
/// A lower bound of x ≥ 0 in single precision.
[[nodiscard]] inline float deflated(double x) {
  return static_cast<float>(x / inflation);
}

}  // namespace hamelin::search

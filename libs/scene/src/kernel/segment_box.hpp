#pragma once
#include "hamelin/geometry/small.hpp"

namespace hamelin::scene::kernel {

/// A capsule's axis, p(t) = a + t w for t in [0, 1].
struct Axis {
  double a[3], w[3];
  double inverse_w[3];  ///< 1/w; 0 where w is 0
};

/// The axis from a to b.
constexpr HAMELIN_INLINE Axis axis_of(const double* a, const double* b) noexcept {
  Axis axis{};
  for (int i = 0; i < 3; ++i) {
    axis.a[i] = a[i];
    axis.w[i] = b[i] - a[i];
    axis.inverse_w[i] = axis.w[i] != 0.0 ? 1.0 / axis.w[i] : 0.0;
  }
  return axis;
}

/// Signed offset of x from the interval [lo, hi], zero inside: a component of
/// docs/theory.md (11.1).
constexpr HAMELIN_INLINE double outside(double x, double lo, double hi) noexcept {
  const double above = x - hi, below = lo - x;
  return (above > 0.0 ? above : 0.0) - (below > 0.0 ? below : 0.0);
}

/// Half the derivative of the squared distance from p(t) to the box, docs/theory.md (11.9). It does
/// not decrease, and is linear between the crossings of the six face planes.
constexpr HAMELIN_INLINE double half_slope(const Axis& axis, const double* lo, const double* hi,
                                           double t) noexcept {
  double g = 0.0;
  for (int i = 0; i < 3; ++i) g += axis.w[i] * outside(axis.a[i] + t * axis.w[i], lo[i], hi[i]);
  return g;
}

constexpr HAMELIN_INLINE double squared_distance(const Axis& axis, const double* lo,
                                                 const double* hi, double t) noexcept {
  double sum = 0.0;
  for (int i = 0; i < 3; ++i) {
    const double e = outside(axis.a[i] + t * axis.w[i], lo[i], hi[i]);
    sum += e * e;
  }
  return sum;
}

/// The t of the point of the axis that is nearest to the box [lo, hi], or the first one if the axis
/// enters the box: docs/theory.md (11.10).
constexpr HAMELIN_INLINE double nearest_along(const Axis& axis, const double* lo,
                                              const double* hi) noexcept {
  double left = 0.0, right = 1.0;
  double g_left = half_slope(axis, lo, hi, 0.0);
  if (g_left >= 0.0) return 0.0;
  double g_right = half_slope(axis, lo, hi, 1.0);
  if (g_right <= 0.0 && squared_distance(axis, lo, hi, 1.0) > 0.0) return 1.0;
  for (int i = 0; i < 3; ++i) {
    for (int side = 0; side < 2; ++side) {
      const double t = ((side == 0 ? lo[i] : hi[i]) - axis.a[i]) * axis.inverse_w[i];
      if (!(t > left && t < right)) continue;
      const double g = half_slope(axis, lo, hi, t);
      if (g < 0.0) {
        left = t;
        g_left = g;
      } else {
        right = t;
        g_right = g;
      }
    }
  }
  return g_right > g_left ? left + (right - left) * (-g_left / (g_right - g_left)) : left;
}

}  // namespace hamelin::scene::kernel

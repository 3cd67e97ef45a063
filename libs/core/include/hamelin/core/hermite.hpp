#pragma once

namespace hamelin {

/// The polynomial between two points of a motion, docs/theory.md (18.14), (18.15), as a function of
/// s = (t − t₀)/h from 0 to 1.
struct Hermite {
  /// Through positions, velocities and accelerations at both points: degree five.
  static constexpr Hermite quintic(double h, double q0, double v0, double a0, double q1, double v1,
                                   double a1) noexcept {
    const double c1 = h * v0, c2 = 0.5 * h * h * a0, dq = q1 - q0 - c1 - c2,
                 slope = h * v1 - c1 - 2.0 * c2, bend = 0.5 * h * h * (a1 - a0);
    return {h,
            q0,
            c1,
            c2,
            10.0 * dq - 4.0 * slope + bend,
            -15.0 * dq + 7.0 * slope - 2.0 * bend,
            6.0 * dq - 3.0 * slope + bend};
  }
  /// Through positions and velocities: degree three.
  static constexpr Hermite cubic(double h, double q0, double v0, double q1, double v1) noexcept {
    const double c1 = h * v0, dq = q1 - q0 - c1, slope = h * v1 - c1;
    return {h, q0, c1, 3.0 * dq - slope, slope - 2.0 * dq, 0.0, 0.0};
  }

  [[nodiscard]] constexpr double position(double s) const noexcept {
    return c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))));
  }
  [[nodiscard]] constexpr double velocity(double s) const noexcept {
    return (c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))) / h;
  }
  [[nodiscard]] constexpr double acceleration(double s) const noexcept {
    return (2.0 * c2 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))) / (h * h);
  }

  double h, c0, c1, c2, c3, c4, c5;
};

}  // namespace hamelin

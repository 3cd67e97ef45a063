#pragma once
#include <cmath>

namespace hamelin::reactive {

/// What is lost before braking acts at full strength.
struct BrakingLoss {
  double lag_s = 0.0;       ///< delay of instantaneous braking that loses as much
  double distance_m = 0.0;  ///< way until then that does not depend on the braking
};

/// The approach speed φ that leaves room to brake, docs/theory.md (10.10): γx up to x = b/γ², then
/// √(2b(x − b/2γ²)).
/// @param x distance from the margin [m] @param brake deceleration b [m/s²] @param rate γ [1/s]
[[nodiscard]] inline double approach_speed(double x, double brake, double rate) {
  if (x <= brake / (rate * rate)) return rate * x;
  return std::sqrt(2.0 * brake * (x - 0.5 * brake / (rate * rate)));
}

/// The same if braking acts late, docs/theory.md (10.31): the speed s for which φ⁻¹(s) + s·lag is
/// the distance x that remains.
[[nodiscard]] inline double approach_speed(double x, double brake, double rate,
                                           const BrakingLoss& loss) {
  const double lag = loss.lag_s, time = lag + 1.0 / rate;
  x -= loss.distance_m;
  if (x <= brake / rate * time) return x / time;
  return std::sqrt(brake * brake * (lag * lag - 1.0 / (rate * rate)) + 2.0 * brake * x) -
         brake * lag;
}

}  // namespace hamelin::reactive

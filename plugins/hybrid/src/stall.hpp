#pragma once
#include <algorithm>
#include <limits>

namespace hamelin::hybrid {

/// Watches progress. A stall is no new best of the distance, by `progress_step`, for a while: a short one where the arm
/// is slow and held back, a long one at any speed. Where the law itself is slow both are longer.
class StallWatch {
 public:
  explicit StallWatch(double quiet_s) : quiet_s_(quiet_s) {}
  void restart(double time_s) {
    best_ = std::numeric_limits<double>::infinity();
    since_s_ = time_s;
  }
  /// @param speed |v| of the joints
  /// @param wanted speed at which the law means to shorten the distance
  /// @param held whether anything holds the arm back from the law's velocity
  [[nodiscard]] bool stalled(double time_s, double distance, double speed, double wanted, bool held) {
    if (distance < best_ - progress_step) {
      best_ = distance;
      since_s_ = time_s;
    }
    const double idle = time_s - since_s_, patience = patience_factor * progress_step / std::max(wanted, 1e-9);
    if (held && speed < slow_speed && idle > quiet_s_ + std::min(patience, longest_s)) return true;
    return idle > long_s + std::min(patience, longest_s);
  }

 private:
  static constexpr double progress_step = 0.01, slow_speed = 0.25, long_s = 1.5, longest_s = 8.0;
  static constexpr double patience_factor = 3.0;
  double quiet_s_;
  double best_ = std::numeric_limits<double>::infinity(), since_s_ = 0.0;
};

}  // namespace hamelin::hybrid

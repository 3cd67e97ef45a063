#pragma once
#include <algorithm>
#include <limits>

namespace hamelin::hybrid {

/// Detects stalls by the rule of docs/theory.md (10.25): the distance has had no new best, by
/// `progress_step`, for some time. The time is short if the arm is slow and held back, and longer
/// at any other speed. Both are extended if the law itself is slow.
class StallDetector {
 public:
  explicit StallDetector(double stall_time_s) : stall_time_s_(stall_time_s) {}
  void set_stall_time(double seconds) noexcept { stall_time_s_ = seconds; }
  void restart(double time_s) {
    best_ = std::numeric_limits<double>::infinity();
    since_s_ = time_s;
  }
  /// @param speed |v| of the joints
  /// @param closing_speed speed at which the law wants to shorten the distance
  /// @param held_back whether anything keeps the arm from the law's velocity
  [[nodiscard]] bool stalled(double time_s, double distance, double speed, double closing_speed,
                             bool held_back) {
    if (distance < best_ - progress_step) {
      best_ = distance;
      since_s_ = time_s;
    }
    const double idle = time_s - since_s_,
                 patience = patience_factor * progress_step / std::max(closing_speed, 1e-9);
    if (held_back && speed < slow_speed &&
        idle > stall_time_s_ + std::min(patience, max_patience_s))
      return true;
    return idle > moving_stall_time_s + std::min(patience, max_patience_s);
  }

 private:
  static constexpr double progress_step = 0.01, slow_speed = 0.25, moving_stall_time_s = 1.5,
                          max_patience_s = 8.0;
  static constexpr double patience_factor = 3.0;
  double stall_time_s_;
  double best_ = std::numeric_limits<double>::infinity(), since_s_ = 0.0;
};

}  // namespace hamelin::hybrid

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

/// Stalls where things may move: an evasion keeps a stall from counting for a while, and an arm
/// that is driven to and fro has stalled too, though the detector takes that for motion.
class StallWatch {
 public:
  /// The arm at the end of a tick.
  struct Moment {
    double time_s;
    double left;                  ///< that remains of the way
    double speed, closing_speed;  ///< as in StallDetector::stalled()
    bool held_back;
    bool evades, moving;  ///< whether the arm evades, and whether there is anything that moves
  };

  explicit StallWatch(double stall_time_s) : detector_(stall_time_s) {}
  void set_stall_time(double seconds) noexcept { detector_.set_stall_time(seconds); }
  void forget_evasion() noexcept { evades_since_s_ = 0.0; }
  /// Begins again, on another course.
  void begin(double time_s) {
    detector_.restart(time_s);
    least_left_ = std::numeric_limits<double>::infinity();
    progress_s_ = time_s;
  }
  /// Gives the detector's time once more.
  void extend(double time_s) { detector_.restart(time_s); }
  /// The rule of the detector alone.
  [[nodiscard]] bool stands(const Moment& now) {
    return detector_.stalled(now.time_s, now.left, now.speed, now.closing_speed, now.held_back);
  }
  [[nodiscard]] bool stalled(const Moment& now) {
    if (!now.evades) {
      evades_since_s_ = now.time_s;
    } else if (now.time_s - evades_since_s_ < longest_wait_s && !makes_no_progress(now)) {
      extend(now.time_s);
      return false;
    }
    return stands(now) || makes_no_progress(now);
  }

 private:
  // The longest time for which an evasion keeps a stall from counting [s].
  static constexpr double longest_wait_s = 6.0;
  static constexpr double patience_s = 3.0, progress = 0.05;

  // Where something moves, only new bests of the remaining length count.
  [[nodiscard]] bool makes_no_progress(const Moment& now) {
    if (now.left < least_left_ - progress || !now.moving) {
      least_left_ = now.left;
      progress_s_ = now.time_s;
    }
    return now.time_s - progress_s_ > patience_s;
  }

  StallDetector detector_;
  double evades_since_s_ = 0.0;
  double least_left_ = 0.0, progress_s_ = 0.0;  ///< least remaining length, and since when
};

}  // namespace hamelin::hybrid

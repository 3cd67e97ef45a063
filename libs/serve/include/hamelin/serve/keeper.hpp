#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <string_view>

#include "hamelin/control/controller.hpp"
#include "hamelin/serve/hamelin_frames.h"

namespace hamelin::serve {

/// Lets a controller tick once for each period, whether its measurement came, is missing, comes
/// late, comes again or is damaged. One thread; a tick does not allocate unless the controller
/// does.
class Keeper {
 public:
  struct Counts {
    std::uint64_t ticks = 0;
    std::uint64_t lost = 0;     ///< periods without a measurement
    std::uint64_t late = 0;     ///< measurements of periods that are over, or that came again
    std::uint64_t damaged = 0;  ///< measurements whose checksum is wrong
    std::uint64_t stops = 0;    ///< times that the controller began to stop the arm, shield apart
  };
  /// @param controller kept by reference, as are the frames
  /// @param period_gap_max so many periods in a row are made up for if measurements are missing
  /// @throws Error invalid for an arm with more joints than a frame has
  Keeper(control::Controller& controller, int period_gap_max);

  /// Another client begins: its sequence numbers and counts start again. If its clock is behind
  /// that of the client before, its times are shifted, because those of a controller may not fall.
  void begin_client();
  /// Takes a measurement. @return whether there is a set point for it; else it is not used
  [[nodiscard]] bool take(const hamelin_measurement& measurement);
  /// No measurement came in this period. @return whether there is a set point; else no arm was seen
  /// yet
  [[nodiscard]] bool miss();

  /// Of the last period, with its checksum.
  [[nodiscard]] const hamelin_setpoint& setpoint() const noexcept { return setpoint_; }
  [[nodiscard]] const Counts& counts() const noexcept { return counts_; }
  /// Whether the client asked to resume since the last call. That takes longer than a period.
  [[nodiscard]] bool wants_resume() noexcept;

 private:
  [[nodiscard]] bool tick(const hamelin_measurement& measurement);
  void take_request(std::uint32_t request);
  void shift_time(double client_s);
  void write(bool unseen);
  void refuse_to_begin(const std::string& cause);
  /// Adds the counts, the cause and the checksum.
  void finish_setpoint(std::string_view cause);

  control::Controller& controller_;
  int gap_max_;
  bool begun_ = false;
  bool wants_resume_ = false;
  bool needs_reset_ = false;
  std::uint64_t sequence_ = 0;  ///< of the last period
  double time_s_ = 0.0;         ///< of the last period, for the controller
  double shift_s_ = 0.0;        ///< time_s_ less the client's time
  bool first_ = true;           ///< whether the client's first measurement is awaited
  std::uint32_t request_ = HAMELIN_REQUEST_NONE;
  Eigen::VectorXd q_, v_;
  Counts counts_;
  hamelin_setpoint setpoint_{};
};

}  // namespace hamelin::serve

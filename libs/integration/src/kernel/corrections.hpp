#pragma once
#include "hamelin/dynamics/kernel/lanes.hpp"

namespace hamelin::integration::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

/// What an iteration for the displacement of a step asks of its corrections [rad or m].
struct CorrectionRule {
  double largest;      ///< one beyond this is on its way to some other root of the step: better to halve the step
  double contraction;  ///< each is at most this share of the one before it,
  double floor;        ///< or at most this: rounding of long chains ends the contraction, not the iteration
  int free;            ///< how many come before any contraction is asked
};

/// Near a root Newton contracts quadratically, and the guess is near.
HAMELIN_INLINE CorrectionRule newton_rule(double largest, double tolerance) noexcept {
  return {largest, 0.5, 1e3 * tolerance, 0};
}
/// Factors made anew, at the worst contraction from the largest correction to 1e-9.
inline constexpr int max_newton_updates = 30;

/// Follows the sizes of an iteration's corrections: the one rule for whether it goes on. NaN never passes.
class Corrections {
 public:
  HAMELIN_INLINE explicit Corrections(const CorrectionRule& rule) noexcept : rule_(rule), allowed_(rule.largest) {}

  /// How the size compares with that of the correction before; 1 for the first.
  HAMELIN_INLINE double pace(double size) const noexcept { return taken_ > 0 ? size / last_ : 1.0; }
  /// Notes a correction that was made. False where the iteration does not head for the root.
  HAMELIN_INLINE bool take(double size) noexcept {
    const bool on_course = size <= allowed_;
    last_ = size;
    if (++taken_ > rule_.free) {
      allowed_ = rule_.contraction * size;
      if (allowed_ < rule_.floor) allowed_ = rule_.floor;
      if (!(allowed_ <= rule_.largest)) allowed_ = rule_.largest;
    }
    return on_course;
  }
  /// Whether a correction only stirs what rounding leaves (`rounding`: the least that it can change), so that no more
  /// is to be gained.
  HAMELIN_INLINE bool at_rounding_floor(double size, double rounding) const noexcept {
    return taken_ > 1 && (size <= rounding || (size > 0.3 * last_ && size <= 1e4 * rounding));
  }

 private:
  CorrectionRule rule_;
  double allowed_, last_ = 0.0;
  int taken_ = 0;
};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::integration::kernel

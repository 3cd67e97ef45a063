#pragma once
#include "hamelin/dynamics/kernel/lanes.hpp"

namespace hamelin::integration::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

/// Bounds on the corrections of an iteration for the displacement of a step [rad or m],
/// docs/theory.md (4.27). A correction beyond them leads to another root or to none, and the step
/// is halved instead.
struct CorrectionRule {
  double largest;      ///< bound on every correction
  double contraction;  ///< a correction is at most this share of the one before it,
  double floor;        ///< or at most this: rounding on long chains ends the contraction earlier
  int unchecked;       ///< how many corrections come before contraction is required
};

/// Newton's method contracts quadratically near a root.
HAMELIN_INLINE CorrectionRule newton_rule(double largest, double tolerance) noexcept {
  return {largest, 0.5, 1e3 * tolerance, 0};
}
/// Enough for the slowest contraction that is accepted, from the largest correction to 1e-9.
inline constexpr int max_newton_updates = 30;

/// Follows the sizes of the corrections of an iteration and decides whether it may continue. NaN is
/// never accepted.
class Corrections {
 public:
  HAMELIN_INLINE explicit Corrections(const CorrectionRule& rule) noexcept
      : rule_(rule), allowed_(rule.largest) {}

  /// The ratio of a size to that of the correction before; 1 for the first correction.
  HAMELIN_INLINE double ratio(double size) const noexcept {
    return count_ > 0 ? size / last_ : 1.0;
  }
  /// Records a correction. False if it breaks the rule.
  HAMELIN_INLINE bool record(double size) noexcept {
    const bool within_bounds = size <= allowed_;
    last_ = size;
    if (++count_ > rule_.unchecked) {
      allowed_ = rule_.contraction * size;
      if (allowed_ < rule_.floor) allowed_ = rule_.floor;
      if (!(allowed_ <= rule_.largest)) allowed_ = rule_.largest;
    }
    return within_bounds;
  }
  /// Whether only rounding errors are left, where `rounding` is their size.
  HAMELIN_INLINE bool at_rounding_floor(double size, double rounding) const noexcept {
    return count_ > 1 && (size <= rounding || (size > 0.3 * last_ && size <= 1e4 * rounding));
  }

 private:
  CorrectionRule rule_;
  double allowed_, last_ = 0.0;
  int count_ = 0;
};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::integration::kernel

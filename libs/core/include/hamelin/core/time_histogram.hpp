#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace hamelin {

/// Counts durations in bins whose bounds grow by a constant factor, docs/theory.md (13.15),
/// (13.16), so that memory does not depend on their number: 64 bins per doubling between 2⁻¹⁰ µs (1
/// ns) and 2³⁰ µs (18 min). A quantile differs from the duration of its rank by at most a factor
/// 2^(1/128) = 1.0054; for durations outside the bounds it is a bound. The largest duration is
/// exact.
class TimeHistogram {
 public:
  /// Largest error of a quantile between the bounds: 2^(1/128) − 1, rounded up.
  static constexpr double relative_error = 0.0055;

  void add(double duration_us) noexcept {
    const double place =
        bins_per_doubling * (std::log2(std::max(smallest_us, duration_us)) - smallest_exponent);
    ++bins_[static_cast<std::size_t>(std::min(place, static_cast<double>(bins_.size() - 1)))];
    largest_ = std::max(largest_, duration_us);
    ++count_;
  }

  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  /// The largest duration [µs]; zero if there is none.
  [[nodiscard]] double largest() const noexcept { return largest_; }

  /// The duration of rank ⌊share (count − 1)⌋, counted from the shortest [µs]. At least one
  /// duration.
  /// @param share from 0 to 1
  [[nodiscard]] double quantile(double share) const noexcept {
    const auto rank = static_cast<std::uint64_t>(share * static_cast<double>(count_ - 1));
    std::size_t bin = 0;
    for (std::uint64_t before = bins_[0]; before <= rank; before += bins_[bin]) ++bin;
    return std::min(
        std::exp2(smallest_exponent + (static_cast<double>(bin) + 0.5) / bins_per_doubling),
        largest_);
  }

 private:
  static constexpr double smallest_exponent = -10.0, smallest_us = 0x1p-10,
                          bins_per_doubling = 64.0;
  static constexpr std::size_t doublings = 40;

  std::array<std::uint64_t, 64 * doublings> bins_{};
  std::uint64_t count_ = 0;
  double largest_ = 0.0;
};

}  // namespace hamelin

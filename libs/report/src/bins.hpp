#pragma once
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace hamelin::report {

/// Thins lines of any length down to a number of points, in one pass and bounded memory: ticks are gathered in bins, of
/// which each line keeps its smallest and largest value, in their order in time. Bins begin as single ticks; when there
/// are too many, neighbours are joined.
class Bins {
 public:
  /// @param points_max at least 4
  Bins(std::size_t lines, std::size_t points_max);

  /// @param y one number a line; NaN for none
  void add(double t, std::span<const double> y);

  /// Times of the points: of a bin's first and last tick, once for a bin of one tick.
  [[nodiscard]] std::vector<double> times() const;
  /// Values of one line at these times.
  [[nodiscard]] std::vector<double> values(std::size_t line) const;

 private:
  struct Span {
    double first, last;
    std::size_t ticks;
  };
  struct Extremes {
    double lo = std::numeric_limits<double>::quiet_NaN(), hi = lo;
    std::uint64_t lo_at = 0, hi_at = 0;  ///< ticks
  };
  static Extremes joined(const Extremes& a, const Extremes& b) noexcept;
  void join_neighbours();

  std::size_t lines_, points_max_;
  std::size_t ticks_per_bin_ = 1;
  std::uint64_t ticks_ = 0;
  std::vector<Span> spans_;
  std::vector<Extremes> extremes_;  ///< bin by bin
};

/// Picks members of a sequence of unknown length evenly, in one pass: every k-th, k a power of two, and the last.
template <class T>
class EvenSample {
 public:
  /// @param most at least 2
  explicit EvenSample(std::size_t most) : most_(most) {}

  void add(T member) {
    if (count_ % every_ == 0) {
      if (members_.size() + 1 == most_ && count_ > 0) {  // one place is the last member's
        for (std::size_t i = 0; 2 * i < members_.size(); ++i)
          if (i > 0) members_[i] = std::move(members_[2 * i]);
        members_.resize((members_.size() + 1) / 2);
        every_ *= 2;
      }
    }
    if (count_ % every_ == 0) members_.push_back(member);
    last_ = std::move(member);
    ++count_;
  }
  /// The picked; the sample is empty then.
  std::vector<T> take() {
    if (count_ > 0 && (count_ - 1) % every_ != 0) members_.push_back(std::move(last_));
    count_ = 0;
    every_ = 1;
    return std::move(members_);
  }

 private:
  std::size_t most_, count_ = 0, every_ = 1;
  std::vector<T> members_;
  T last_{};
};

}  // namespace hamelin::report

#pragma once
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace hamelin::report {

/// Reduces lines of any length to a limited number of points, in one pass and bounded memory. Ticks
/// are collected in bins. Each line keeps its smallest and largest value per bin, in their order in
/// time. Bins start as single ticks; when there are too many, neighbouring bins are merged.
class Bins {
 public:
  /// @param points_max at least 4
  Bins(std::size_t lines, std::size_t points_max);

  /// @param y one number per line; NaN for none
  void add(double t, std::span<const double> y);

  /// Times of the points: the first and the last tick of each bin, or the only one.
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
    std::uint64_t lo_at = 0, hi_at = 0;  ///< ticks of the two values
  };
  static Extremes merged(const Extremes& a, const Extremes& b) noexcept;
  void merge_neighbours();

  std::size_t lines_, points_max_;
  std::size_t ticks_per_bin_ = 1;
  std::uint64_t ticks_ = 0;
  std::vector<Span> spans_;
  std::vector<Extremes> extremes_;  ///< bin by bin
};

/// Samples a sequence of unknown length evenly, in one pass: every k-th member, with k a power of
/// two, and the last one.
template <class T>
class EvenSample {
 public:
  /// @param size_max at least 2
  explicit EvenSample(std::size_t size_max) : size_max_(size_max) {}

  void add(T member) {
    if (count_ % every_ == 0) {
      // one place is reserved for the last member
      if (members_.size() + 1 == size_max_ && count_ > 0) {
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
  /// Returns the sampled members and empties the sample.
  std::vector<T> take() {
    if (count_ > 0 && (count_ - 1) % every_ != 0) members_.push_back(std::move(last_));
    count_ = 0;
    every_ = 1;
    return std::move(members_);
  }

 private:
  std::size_t size_max_, count_ = 0, every_ = 1;
  std::vector<T> members_;
  T last_{};
};

}  // namespace hamelin::report

#include "bins.hpp"

#include <cmath>

namespace hamelin::report {

Bins::Bins(std::size_t lines, std::size_t points_max) : lines_(lines), points_max_(points_max) {}

Bins::Extremes Bins::merged(const Extremes& a, const Extremes& b) noexcept {
  if (std::isnan(a.lo)) return b;
  if (std::isnan(b.lo)) return a;
  Extremes both = a;
  if (b.lo < a.lo) {
    both.lo = b.lo;
    both.lo_at = b.lo_at;
  }
  if (b.hi > a.hi) {
    both.hi = b.hi;
    both.hi_at = b.hi_at;
  }
  return both;
}

void Bins::merge_neighbours() {
  std::size_t kept = 0;
  for (std::size_t bin = 0; bin < spans_.size(); bin += 2, ++kept) {
    const bool pair = bin + 1 < spans_.size();
    spans_[kept] = pair ? Span{spans_[bin].first, spans_[bin + 1].last,
                               spans_[bin].ticks + spans_[bin + 1].ticks}
                        : spans_[bin];
    for (std::size_t line = 0; line < lines_; ++line) {
      const Extremes& even = extremes_[bin * lines_ + line];
      extremes_[kept * lines_ + line] =
          pair ? merged(even, extremes_[(bin + 1) * lines_ + line]) : even;
    }
  }
  spans_.resize(kept);
  extremes_.resize(kept * lines_);
  ticks_per_bin_ *= 2;
}

void Bins::add(double t, std::span<const double> y) {
  if (spans_.empty() || spans_.back().ticks == ticks_per_bin_) {
    while (spans_.size() >= (ticks_per_bin_ == 1 ? points_max_ : points_max_ / 2))
      merge_neighbours();
    if (spans_.empty() || spans_.back().ticks == ticks_per_bin_) {
      spans_.push_back({t, t, 0});
      extremes_.resize(extremes_.size() + lines_);
    }
  }
  spans_.back().last = t;
  ++spans_.back().ticks;
  Extremes* const bin = &extremes_[(spans_.size() - 1) * lines_];
  for (std::size_t line = 0; line < lines_; ++line)
    bin[line] = merged(bin[line], {y[line], y[line], ticks_, ticks_});
  ++ticks_;
}

std::vector<double> Bins::times() const {
  std::vector<double> t;
  for (const Span& span : spans_) {
    t.push_back(span.first);
    if (span.ticks > 1) t.push_back(span.last);
  }
  return t;
}

std::vector<double> Bins::values(std::size_t line) const {
  std::vector<double> y;
  for (std::size_t bin = 0; bin < spans_.size(); ++bin) {
    const Extremes& e = extremes_[bin * lines_ + line];
    const bool rising = e.lo_at <= e.hi_at;
    y.push_back(rising ? e.lo : e.hi);
    if (spans_[bin].ticks > 1) y.push_back(rising ? e.hi : e.lo);
  }
  return y;
}

}  // namespace hamelin::report

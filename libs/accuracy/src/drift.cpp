#include <array>
#include <cmath>

#include "hamelin/accuracy/accuracy.hpp"

namespace hamelin::accuracy {

namespace {

constexpr std::size_t most_blocks = 128;

struct Grouping {
  std::size_t blocks;
  double t;  ///< quantile of 97.5 % of Student's distribution with blocks − 2 degrees of freedom
};
constexpr std::array<Grouping, 4> groupings{
    {{64, 1.99897}, {32, 2.04227}, {16, 2.14479}, {8, 2.44691}}};

}  // namespace

// docs/theory.md (13.9)
void Drift::join(Block& into, const Block& other) {
  const double sum = into.count + other.count;
  into.time_s += (other.time_s - into.time_s) * (other.count / sum);
  into.value += (other.value - into.value) * (other.count / sum);
  into.count = sum;
}

void Drift::add(double time_s, double value) {
  ++samples_;
  const Block sample{1.0, time_s, value};
  if (!blocks_.empty() && blocks_.back().count < static_cast<double>(per_block_)) {
    join(blocks_.back(), sample);
    return;
  }
  if (blocks_.size() == most_blocks) {
    for (std::size_t i = 0; i < most_blocks / 2; ++i) {
      join(blocks_[2 * i], blocks_[2 * i + 1]);
      blocks_[i] = blocks_[2 * i];
    }
    blocks_.resize(most_blocks / 2);
    per_block_ *= 2;
  }
  blocks_.push_back(sample);
}

// docs/theory.md (13.10), (13.11)
std::optional<Slope> Drift::slope() const {
  if (samples_ < 16) return std::nullopt;
  Slope slope;
  bool first = true;
  for (const auto& [count, t] : groupings) {
    if (blocks_.size() < count) continue;
    std::vector<Block> groups(count);
    for (std::size_t i = 0; i < blocks_.size(); ++i)
      join(groups[i * count / blocks_.size()], blocks_[i]);
    Block mean;
    for (const auto& g : groups) join(mean, g);
    double tt = 0.0, te = 0.0;
    for (const auto& g : groups) {
      tt += g.count * (g.time_s - mean.time_s) * (g.time_s - mean.time_s);
      te += g.count * (g.time_s - mean.time_s) * (g.value - mean.value);
    }
    if (!(tt > 0.0)) return std::nullopt;
    const double value = te / tt;
    double scatter = 0.0;
    for (const auto& g : groups) {
      const double residual = g.value - mean.value - value * (g.time_s - mean.time_s);
      scatter += g.count * residual * residual;
    }
    if (first) slope.value = value;
    first = false;
    slope.half_width =
        std::max(slope.half_width, t * std::sqrt(scatter / static_cast<double>(count - 2) / tt));
  }
  return slope;
}

}  // namespace hamelin::accuracy

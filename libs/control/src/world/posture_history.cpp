#include "world/posture_history.hpp"

#include <algorithm>

namespace hamelin::control {

PostureHistory::PostureHistory(Eigen::Index dof, std::size_t capacity)
    : dof_(static_cast<std::size_t>(dof)),
      stride_(dof_ + 2),
      capacity_(capacity),
      values_(capacity * stride_) {}

void PostureHistory::record(double time_s, const Eigen::VectorXd& q, std::uint64_t load) noexcept {
  const std::uint64_t count = count_.load(std::memory_order_relaxed);
  if (count > 0 && time_s < last_s_) first_.store(count, std::memory_order_relaxed);
  last_s_ = time_s;
  std::atomic<double>* const to = entry(count);
  // whoever reads one of these numbers knows that the entry's last ones are gone
  to[0].store(time_s, std::memory_order_release);
  to[1].store(static_cast<double>(load), std::memory_order_release);
  for (std::size_t i = 0; i < dof_; ++i)
    to[2 + i].store(q[static_cast<Eigen::Index>(i)], std::memory_order_release);
  count_.store(count + 1, std::memory_order_release);
}

// An entry that was overwritten meanwhile is none: the one that is written next is the oldest.
std::optional<PostureHistory::Posture> PostureHistory::read(std::uint64_t index) const {
  const std::atomic<double>* const from = entry(index);
  Posture out;
  out.time_s = from[0].load(std::memory_order_acquire);
  out.load = static_cast<std::uint64_t>(from[1].load(std::memory_order_acquire));
  out.q.resize(static_cast<Eigen::Index>(dof_));
  for (std::size_t i = 0; i < dof_; ++i)
    out.q[static_cast<Eigen::Index>(i)] = from[2 + i].load(std::memory_order_acquire);
  if (count_.load(std::memory_order_acquire) >= index + capacity_) return std::nullopt;
  return out;
}

std::optional<PostureHistory::Posture> PostureHistory::newest() const {
  const std::uint64_t count = count_.load(std::memory_order_acquire);
  return count > 0 ? read(count - 1) : std::nullopt;
}

std::optional<PostureHistory::Posture> PostureHistory::at(double time_s) const {
  const std::uint64_t count = count_.load(std::memory_order_acquire);
  if (count == 0) return std::nullopt;
  const std::uint64_t first =
      std::max(first_.load(std::memory_order_relaxed), count - std::min(count, capacity_ - 1));
  // the last one that is not later than the time
  std::uint64_t lo = first, hi = count;
  while (lo < hi) {
    const std::uint64_t middle = lo + (hi - lo) / 2;
    if (entry(middle)[0].load(std::memory_order_acquire) <= time_s)
      lo = middle + 1;
    else
      hi = middle;
  }
  if (lo == first) return std::nullopt;
  std::optional<Posture> before = read(lo - 1);
  if (!before || lo == count) return before;
  const std::optional<Posture> after = read(lo);
  if (!after) return std::nullopt;
  const double share = (time_s - before->time_s) / (after->time_s - before->time_s);
  before->q += share * (after->q - before->q);
  before->time_s = time_s;
  return before;
}

}  // namespace hamelin::control

#pragma once
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/sweep/plan.hpp"

namespace hamelin::sweep {

/// One of `count` parts of a plan, so that several machines can share its runs. `index` counts from
/// one.
struct Shard {
  std::size_t index = 1, count = 1;
};

/// The largest number of shards of a plan.
inline constexpr std::size_t shards_max = 100'000;

/// Reads "3/40". @param option prefix of the message @throws Error usage
[[nodiscard]] Shard parse_shard(std::string_view text, std::string_view option);
/// "3/40"
[[nodiscard]] std::string to_string(const Shard& shard);

/// Indices into `plan.runs` of the runs of a shard, ascending. Each run belongs to one shard, and
/// the sizes of shards differ by at most one. Runs are dealt out in the order of a hash of their
/// ids: neighbours in a plan differ in the planner or in a value, and a plain stride would give all
/// runs of the slowest planner to one shard.
[[nodiscard]] std::vector<std::size_t> runs_of_shard(const Plan& plan, const Shard& shard);

}  // namespace hamelin::sweep

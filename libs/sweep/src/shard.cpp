#include "hamelin/sweep/shard.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <utility>

#include "hamelin/core/error.hpp"

namespace hamelin::sweep {

namespace {

/// FNV-1a with 64 bits (Fowler, Noll, Vo), and the finaliser of splitmix64, which makes its high
/// bits depend on every letter.
std::uint64_t hash_of(std::string_view text) {
  std::uint64_t h = 0xcbf29ce484222325ULL;
  for (const char c : text) {
    h ^= static_cast<unsigned char>(c);
    h *= 0x100000001b3ULL;
  }
  h = (h ^ (h >> 30)) * 0xbf58476d1ce4e5b9ULL;
  h = (h ^ (h >> 27)) * 0x94d049bb133111ebULL;
  return h ^ (h >> 31);
}

}  // namespace

Shard parse_shard(std::string_view text, std::string_view option) {
  Shard shard{0, 0};
  const char* const end = text.data() + text.size();
  const auto index = std::from_chars(text.data(), end, shard.index);
  if (index.ec == std::errc{} && index.ptr != end && *index.ptr == '/') {
    const auto count = std::from_chars(index.ptr + 1, end, shard.count);
    if (count.ec == std::errc{} && count.ptr == end && shard.count <= shards_max &&
        shard.index >= 1 && shard.index <= shard.count)
      return shard;
  }
  throw Error(
      ErrorCode::usage,
      fmt::format("{}: '{}' is not a shard, expected I/N with 1 <= I <= N <= {}, as in 3/40",
                  option, text, shards_max));
}

std::string to_string(const Shard& shard) {
  return fmt::format("{}/{}", shard.index, shard.count);
}

std::vector<std::size_t> runs_of_shard(const Plan& plan, const Shard& shard) {
  std::vector<std::pair<std::uint64_t, std::size_t>> order;
  order.reserve(plan.runs.size());
  for (std::size_t i = 0; i < plan.runs.size(); ++i)
    order.emplace_back(hash_of(plan.runs[i].id), i);
  std::sort(order.begin(), order.end());
  std::vector<std::size_t> runs;
  for (std::size_t k = shard.index - 1; k < order.size(); k += shard.count)
    runs.push_back(order[k].second);
  std::sort(runs.begin(), runs.end());
  return runs;
}

}  // namespace hamelin::sweep

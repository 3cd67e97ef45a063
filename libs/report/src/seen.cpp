#include "seen.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace hamelin::report {

namespace {

// More of them make a page slow.
constexpr std::size_t voxels_max = 60000;
constexpr std::int64_t key_limit = 32768;

bool is_run(const Json& run) {
  const auto is_key = [](const Json& number) {
    return number.is_number_integer() && number.get<std::int64_t>() >= -key_limit &&
           number.get<std::int64_t>() < key_limit;
  };
  return run.is_array() && run.size() == 4 && std::all_of(run.begin(), run.end(), is_key) &&
         run[0].get<std::int64_t>() + run[3].get<std::int64_t>() <= key_limit;
}

}  // namespace

bool Seen::add(const Json& runs, double time_s) {
  if (!runs.is_array() || !std::all_of(runs.begin(), runs.end(), is_run)) return false;
  for (const Json& run : runs)
    for (std::int64_t k = 0; k < run[3].get<std::int64_t>(); ++k) {
      if (since_s_.size() == voxels_max) {
        ++left_out_;
        continue;
      }
      voxels_.push_back(static_cast<std::int16_t>(run[0].get<std::int64_t>() + k));
      for (const std::size_t i : {1, 2}) voxels_.push_back(run[i].get<std::int16_t>());
      since_s_.push_back(time_s);
    }
  return true;
}

Json Seen::json(Container& container, bool alone, std::vector<std::string>& notes) const {
  if (since_s_.empty()) return nullptr;
  if (left_out_ > 0)
    notes.push_back(
        fmt::format("of the voxels that were seen, the last {} are not shown", left_out_));
  return {{"lo", container.exact(voxels_)}, {"since", container.exact(since_s_)}, {"alone", alone}};
}

}  // namespace hamelin::report

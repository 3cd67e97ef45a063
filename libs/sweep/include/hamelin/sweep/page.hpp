#pragma once
#include <cstddef>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/sweep/compare.hpp"
#include "hamelin/sweep/merge.hpp"

namespace hamelin::sweep {

/// A page with the replayed scene of a run.
struct ReplayLink {
  std::string file;     ///< relative to the page of the study
  double time_s = 0.0;  ///< at which it opens, that of the judge's contact
};

/// What a page shows in addition to the runs.
struct PageExtras {
  std::map<std::size_t, ReplayLink> replays;  ///< by the index of the run
  /// Paired comparisons with their titles.
  std::vector<std::pair<std::string, std::vector<Comparison>>> comparisons;
};

/// The comparisons that a page shows without being asked: all ablations, and each two planners, up
/// to eight.
[[nodiscard]] std::vector<std::pair<std::string, std::vector<Comparison>>> comparisons_of_page(
    const Sweeps& sweeps);

/// Data of the page of a sweep, hamelin.sweep-page/2: the summary and all runs in columns. The
/// README describes the format.
[[nodiscard]] Json page_json(const Merged& merged, const PageExtras& extras = {});

}  // namespace hamelin::sweep

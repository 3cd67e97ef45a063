#pragma once
#include <functional>
#include <string_view>

#include "hamelin/sweep/merge.hpp"

namespace hamelin::sweep {

/// Passes on the runs as CSV, line by line: the names, then one line per run, in the order of the
/// plans. Fields are quoted as by csv_field(). Columns: id, directory, the labels, the varied
/// values by pointer, the gains, feasible, reason, outcome, failure, cause, time_s, clearance_m,
/// self_clearance_m, certified_share, tick_us_p50, tick_us_p99, judge. Values that do not apply are
/// empty.
void write_csv(const Sweeps& sweeps, const std::function<void(std::string_view line)>& write);

}  // namespace hamelin::sweep

#pragma once
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/sweep/merge.hpp"

namespace hamelin::sweep {

/// What page, CSV and comparisons show of a record; small, so that 10⁵ of them fit into memory.
struct RunFacts {
  bool recorded = false;
  std::string outcome, cause;  ///< as in the record; empty if there is none
  std::string failure;         ///< failure_class()
  std::string contact;         ///< judged_contact()
  std::optional<double> time_s, clearance_m, self_clearance_m, certified_share;
  std::optional<double> tick_us_p50, tick_us_p99;
};

/// The facts of a record, hamelin.record/1 or null.
[[nodiscard]] RunFacts facts_of(const Json& record);

/// The values that vary within a sweep: (JSON pointer, value) for each "/pointer=VALUE" of the
/// run's label "values".
[[nodiscard]] std::vector<std::pair<std::string, std::string>> varied_values(const PlannedRun& run);

/// The runs as CSV: a line of names, then one line per run, in the order of the plans. Fields with
/// a comma, a quote or a line break are quoted (RFC 4180); lines end with "\n". Columns: id,
/// directory, the labels, the varied values by pointer, the gains, feasible, reason, outcome,
/// failure, cause, time_s, clearance_m, self_clearance_m, certified_share, tick_us_p50,
/// tick_us_p99, judge. Values that do not apply are empty.
[[nodiscard]] std::string to_csv(const Merged& merged);

}  // namespace hamelin::sweep

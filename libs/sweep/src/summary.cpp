#include "hamelin/sweep/pairs.hpp"
#include "statistics.hpp"

namespace hamelin::sweep {

Summary summarize(const std::vector<log::Result>& results) {
  Summary summary;
  summary.runs = results.size();
  std::vector<double> clearances, shares, reached, p50, p99;
  for (const auto& result : results) {
    ++summary.outcomes[static_cast<std::size_t>(result.outcome)];
    summary.time_s += result.time_s;
    summary.cpu_s += result.cpu_s;
    if (result.min_clearance_m) clearances.push_back(*result.min_clearance_m);
    if (result.certified_share) shares.push_back(*result.certified_share);
    if (result.outcome == log::Outcome::reached) reached.push_back(result.time_s);
    if (result.tick_us) {
      p50.push_back(result.tick_us->p50);
      p99.push_back(result.tick_us->p99);
    }
  }
  summary.min_clearance_m = smallest(clearances);
  summary.certified_share_mean = mean(shares);
  summary.certified_share_min = smallest(shares);
  summary.reached_time_s_median = median(reached);
  summary.reached_time_s_max = largest(reached);
  summary.tick_us_p50_median = median(p50);
  summary.tick_us_p99_median = median(p99);
  summary.tick_us_p99_max = largest(p99);
  return summary;
}

Json to_json(const Summary& summary) {
  Json outcomes = Json::object();
  for (std::size_t i = 0; i < Summary::outcome_count; ++i)
    outcomes[std::string(log::to_string(static_cast<log::Outcome>(i)))] = summary.outcomes[i];
  return {{"runs", summary.runs},
          {"outcomes", std::move(outcomes)},
          {"min_clearance_m", or_null(summary.min_clearance_m)},
          {"certified_share_mean", or_null(summary.certified_share_mean)},
          {"certified_share_min", or_null(summary.certified_share_min)},
          {"reached_time_s_median", or_null(summary.reached_time_s_median)},
          {"reached_time_s_max", or_null(summary.reached_time_s_max)},
          {"time_s", summary.time_s},
          {"timing",
           {{"tick_us_p50_median", or_null(summary.tick_us_p50_median)},
            {"tick_us_p99_median", or_null(summary.tick_us_p99_median)},
            {"tick_us_p99_max", or_null(summary.tick_us_p99_max)},
            {"cpu_s", summary.cpu_s}}}};
}

}  // namespace hamelin::sweep

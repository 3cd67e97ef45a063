#pragma once
#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/sweep/plan.hpp"

namespace hamelin::sweep {

/// A share with the bounds between which it lies.
struct Interval {
  double low = 0.0, high = 1.0;
};

/// Wilson's score interval of `hits` in `all` at 95 % (z = 1.959964): the shares p whose normal test does not reject
/// what was seen, |p̂ − p| ≤ z √(p(1 − p)/n). All of [0, 1] for none in none.
[[nodiscard]] Interval wilson(std::size_t hits, std::size_t all);

/// A planned run, and its record if there is one.
struct MergedRun {
  PlannedRun run;
  std::filesystem::path directory;  ///< of its plan
  bool feasible = true;
  std::string reason;  ///< why not
  Json record;         ///< null: not run yet
};

/// Plans and records of several directories, in the order given.
/// @throws Error as read_plan and read_records; invalid if directories disagree
[[nodiscard]] std::vector<MergedRun> read_sweeps(const std::vector<std::filesystem::path>& directories);

/// Runs of one kind in a few numbers. Outcomes are the judged ones: contact seen by the judge is a collision. Medians
/// of even counts are the lower of the two in the middle.
struct Group {
  std::vector<std::string> key;  ///< the labels' values, in the order asked for
  std::size_t planned = 0, runs = 0;
  std::size_t feasible = 0;                     ///< of the runs
  std::size_t reached = 0;                      ///< of the feasible runs
  std::size_t reached_all = 0;                  ///< of all runs
  Interval reached_interval;                    ///< of reached among feasible
  std::map<std::string, std::size_t> outcomes;  ///< of all runs, "crashed" among them
  std::size_t contacts = 0;                     ///< runs in which the judge saw contact
  std::size_t judged = 0;                       ///< runs that were judged where there is something to hit
  std::optional<double> min_clearance_m;        ///< the judge's, from obstacles
  std::optional<double> min_self_clearance_m;   ///< the judge's, of the arm from itself
  std::optional<double> certified_share_mean, certified_share_min;
  std::optional<double> reached_time_s_median;
  std::optional<double> tick_us_p50_median, tick_us_p99_median;
  double filter_work_J_max = 0.0;  ///< largest of any run; not above 0 to rounding
  std::optional<double> recovery_work_J_median;
  std::map<std::string, double> escapes;      ///< numbers of the results' "escape", summed
  std::map<std::string, std::size_t> causes;  ///< of runs that did not reach
};

/// Groups by labels, in order of their values; a run without a label has "" there.
/// @throws Error usage for a label that no run has
[[nodiscard]] std::vector<Group> group(const std::vector<MergedRun>& runs, const std::vector<std::string>& by);

/// What a planner makes of gain sets that are known to reach where there is no obstacle.
struct GainGroup {
  std::string planner;
  std::size_t sets = 0;       ///< run with this planner
  std::size_t reached = 0;    ///< of these, without contact
  std::size_t contacts = 0;   ///< of these, seen by the judge
  std::size_t reference = 0;  ///< of these, sets whose run without the obstacle reached
  std::size_t reached_of_reference = 0;
  Interval interval;            ///< of reached_of_reference among reference
  std::size_t apf_stalled = 0;  ///< of these, sets with which plain apf stalls
  std::size_t reached_of_apf_stalled = 0;
};

/// Empty where no run has gains; the runs without the obstacle have no entry. Sets are those of one seed and directory.
[[nodiscard]] std::vector<GainGroup> group_gains(const std::vector<MergedRun>& runs);

/// Everything that a merge found.
struct Merged {
  std::vector<MergedRun> runs;
  std::vector<std::string> by;  ///< labels
  std::vector<Group> groups;
  std::vector<GainGroup> gains;
  std::vector<std::string> notes;  ///< what a reader should know, e.g. that records come from several builds
};
/// Reads, groups and sums up. @throws Error as read_sweeps and group
[[nodiscard]] Merged merge(const std::vector<std::filesystem::path>& directories, const std::vector<std::string>& by);

/// The summary as JSON.
[[nodiscard]] Json to_json(const Merged& merged);

/// The summary as a table of plain text, and the causes of what did not reach.
[[nodiscard]] std::string to_table(const Merged& merged);

/// What the page of a sweep shows, hamelin.sweep-page/1: the summary, the gain sets, and each run that did not reach
/// with its cause and the command that repeats it. The README says what is in it.
[[nodiscard]] Json page_json(const Merged& merged);

}  // namespace hamelin::sweep

#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/sweep/plan.hpp"
#include "hamelin/sweep/run_facts.hpp"

namespace hamelin::sweep {

/// A confidence interval of a share.
struct Interval {
  double low = 0.0, high = 1.0;
};

/// Wilson's score interval at 95 % (z = 1.959964) for p̂ = `successes` / n, n = `trials`: all
/// shares p that a normal test does not reject, |p̂ − p| ≤ z √(p(1 − p)/n). [0, 1] for 0 trials.
[[nodiscard]] Interval wilson_interval(std::size_t successes, std::size_t trials);

/// Where the line of a record is.
struct RecordPlace {
  std::size_t file = 0;                 ///< index into Sweeps::files
  std::uint64_t offset = 0, bytes = 0;  ///< without the end of the line
};

/// A planned run, and its record if there is one.
struct MergedRun {
  PlannedRun run;
  std::filesystem::path directory;  ///< of its plan
  bool feasible = true;
  std::string reason;  ///< why it is not feasible
  RunFacts facts;      ///< of its record; facts.recorded is false if it has not run yet
  RecordPlace place;
};

/// Plans and records of several directories.
struct Sweeps {
  std::vector<MergedRun> runs;               ///< in the order of directories and plans
  std::vector<std::filesystem::path> files;  ///< of records
  /// Builds that made the records, of the program and of each planner.
  std::map<std::string, std::set<std::string>> builds;
  Json machine;  ///< host, isa and build of the first record that names them; null if none does
  std::size_t repeated = 0;            ///< runs with equal records in several files
  std::vector<std::string> different;  ///< ids of runs whose records differ between files
  std::vector<Ablation> ablations;     ///< of the plans, each once
};

/// Reads plans and records. Directories with the same plan are copies of one sweep: their records
/// are joined. A run that several files record counts once, with its first record that is not a
/// crash, in the order of directories and names of files.
/// @param timing as in facts_of()
/// @throws Error as read_plan and read_records
[[nodiscard]] Sweeps read_sweeps(const std::vector<std::filesystem::path>& directories,
                                 bool timing = true);

/// The same, but directories with the same plan stay apart: for comparing two executions of a plan.
[[nodiscard]] Sweeps read_sweeps_apart(const std::vector<std::filesystem::path>& directories);

/// Writes the records of all runs in the order of the plans, as a file of records. The bytes do not
/// depend on the number of shards, or on the order in which runs ended.
/// @param timing whether to keep what depends on machine and time; without it, repeated studies of
///        one build give equal bytes
/// @throws Error io
void write_records(const Sweeps& sweeps, const std::filesystem::path& file, bool timing);

/// Summary of the runs with the same labels. Outcomes include the judge: contact that it saw is a
/// collision. The median of an even number of values is the lower of the two in the middle.
struct Group {
  std::vector<std::string> key;  ///< values of the labels, in the order of the labels
  std::size_t planned = 0, runs = 0;
  std::size_t feasible = 0;                     ///< of the runs
  std::size_t reached = 0;                      ///< of the feasible runs
  std::size_t reached_all = 0;                  ///< of all runs
  Interval reached_interval;                    ///< of reached among feasible
  std::map<std::string, std::size_t> outcomes;  ///< of all runs, including "crashed"
  std::size_t contacts = 0;                     ///< runs in which the judge saw contact
  std::size_t judged = 0;                       ///< runs in which the judge measured a distance
  /// Runs with a plant that detects contacts itself, and those in which it counted one.
  std::size_t plant_runs = 0, plant_contacts = 0;
  std::optional<double> min_clearance_m;       ///< the judge's, from obstacles
  std::optional<double> min_self_clearance_m;  ///< the judge's, of the arm from itself
  std::optional<double> certified_share_mean, certified_share_min;
  std::optional<double> reached_time_s_median;
  /// Mean over runs of the mean change of the torque from tick to tick [Nm or N]; none under ideal
  /// actuation.
  std::optional<double> torque_change_mean;
  std::optional<double> tick_us_p50_median, tick_us_p99_median;
  double filter_work_J_max = 0.0;  ///< largest over the runs; positive only by rounding errors
  std::optional<double> recovery_work_J_median;
  std::map<std::string, double> escapes;  ///< sums of the numbers in the results' "escape"
  /// Runs that did not reach their goal, by failure_class().
  std::map<std::string, std::size_t> causes;
};

/// Groups runs by labels, sorted by their values; the value of a missing label is "".
/// @throws Error usage for a label that no run has
[[nodiscard]] std::vector<Group> group(const std::vector<MergedRun>& runs,
                                       const std::vector<std::string>& by);

/// Runs of a group that failed: stalled, timeout, collision, and by any other outcome.
[[nodiscard]] std::array<std::size_t, 4> failures_by_end(const Group& group);

/// Results of one planner with the gain sets, compared with the runs without the obstacle and with
/// plain apf.
struct GainGroup {
  std::string planner;
  std::size_t sets = 0;       ///< run with this planner
  std::size_t reached = 0;    ///< of `sets`: reached the goal without contact
  std::size_t contacts = 0;   ///< of `sets`: the judge saw contact
  std::size_t reference = 0;  ///< of `sets`: reached the goal in the run without the obstacle
  std::size_t reached_of_reference = 0;
  Interval interval;            ///< of reached_of_reference among reference
  std::size_t apf_stalled = 0;  ///< of `sets`: plain apf stalls with the set
  std::size_t reached_of_apf_stalled = 0;
};

/// One entry per planner; none for the runs without the obstacle, and empty if no run has gains.
/// Runs of the same set are those with the same gains, seed, varied values and directory.
[[nodiscard]] std::vector<GainGroup> group_gains(const std::vector<MergedRun>& runs);

/// Result of a merge.
struct Merged {
  Sweeps sweeps;
  std::vector<std::string> by;  ///< labels
  std::vector<Group> groups;
  std::vector<GainGroup> gains;
  std::vector<std::string> notes;  ///< remarks, such as that records come from several builds
};
/// Groups and summarizes sweeps. @throws Error as group
[[nodiscard]] Merged merge(Sweeps&& sweeps, const std::vector<std::string>& by);

/// The summary as JSON.
[[nodiscard]] Json to_json(const Merged& merged);

/// The summary as a plain-text table, followed by the causes of the runs that did not reach their
/// goal.
[[nodiscard]] std::string to_table(const Merged& merged);

}  // namespace hamelin::sweep

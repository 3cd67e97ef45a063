#pragma once
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"

/// A sweep is a directory: `plan.json` (hamelin.sweep/1), what the plan made (`scenes/`), and `records.jsonl`
/// (hamelin.record/1), one line a run in the order in which they ended.
namespace hamelin::study {

/// The "problem" label of runs of gain sets without the obstacle.
inline constexpr const char* no_obstacle = "no obstacle";

/// A scene of a plan.
struct SweepScene {
  std::string file;    ///< as seen from the plan's directory
  std::string sha256;  ///< of its bytes
  bool feasible = true;
  std::string reason;  ///< why not; see study::feasibility
};

/// One run of a plan: a scene with another planner, values set, and a seed.
struct SweepRun {
  std::string id;     ///< unique in the plan
  std::string scene;  ///< SweepScene::file
  std::optional<std::string> planner;
  std::vector<std::string> set;  ///< "/json/pointer=VALUE", applied in this order after the planner
  std::uint64_t seed = 1;
  std::map<std::string, std::string> labels;  ///< by which runs are grouped: family, problem, goal, planner, …
  std::map<std::string, double> gains;        ///< of a gain set; empty else
};

struct SweepPlan {
  std::vector<SweepScene> scenes;
  std::vector<SweepRun> runs;
  std::string sha256;  ///< of the plan's file; empty before it is written
};

/// The document that is written; the same plan gives the same bytes.
[[nodiscard]] Json to_json(const SweepPlan& plan);
/// Writes `directory`/plan.json. @throws Error io; usage where the directory holds records of another plan
void write_plan(SweepPlan& plan, const std::filesystem::path& directory);
/// `directory`/plan.json. @throws Error io, parse or invalid: "file: place: what is wrong, what was expected"
[[nodiscard]] SweepPlan read_plan(const std::filesystem::path& directory);
/// The same for a file of any name.
[[nodiscard]] SweepPlan read_plan_file(const std::filesystem::path& file);

[[nodiscard]] std::filesystem::path plan_file(const std::filesystem::path& directory);
[[nodiscard]] std::filesystem::path records_file(const std::filesystem::path& directory);

/// The records of a plan, as far as there are any.
struct Records {
  std::vector<Json> lines;
  std::size_t good_bytes = 0;  ///< of the file: up to the end of its last whole line
  bool cut = false;            ///< whether something followed it: a line that was not finished
};
/// @throws Error parse or invalid, naming file and line, for what is no record of this plan
[[nodiscard]] Records read_records(const std::filesystem::path& directory, const SweepPlan& plan);

/// The command line of one run, without the program: `sweep one …` (what a sweep starts) or `run …`.
[[nodiscard]] std::vector<std::string> run_arguments(const SweepRun& run, const std::filesystem::path& directory);

/// How a sweep is run.
struct SweepOptions {
  std::vector<std::string> command;  ///< what run_arguments() are appended to: the program and what begins its line
  std::size_t jobs = 1;              ///< processes at the same time
  std::string only;                  ///< runs whose id holds this; empty: all
  std::optional<std::size_t> limit;  ///< at most so many runs now
  bool fresh = false;                ///< drop the records that are there
  std::optional<double> timeout_s;   ///< of wall clock: a run that takes longer is killed
  const std::atomic<bool>* stop = nullptr;                         ///< once set, children are told to end
  std::function<void(std::size_t done, std::size_t all)> on_done;  ///< after each record, of those to be run now
};

struct SweepOutcome {
  std::size_t planned = 0;   ///< chosen by `only`
  std::size_t recorded = 0;  ///< of these, before
  std::size_t run = 0;       ///< of these, now
  std::size_t crashed = 0;   ///< of those run now
  bool dropped_cut_line = false;
  bool stopped = false;
};

/// Runs what has no record yet, each in a process of its own, and appends a record each, flushed. A run that crashes is
/// recorded as `crashed`, with its signal or exit code and its last words; so is one that is killed after `timeout_s`.
/// A child prints one line of JSON,
/// {"result": …, "judge": …}, or exits with code 2 and one line that says what is wrong with its input: then no other
/// run is begun.
/// @throws Error io, parse or invalid (a plan or scene that is not what was planned); usage for 0 jobs; invalid, naming
///         the run, for bad input found by a child
SweepOutcome run_sweep(const std::filesystem::path& directory, const SweepOptions& options);

}  // namespace hamelin::study

#pragma once
#include <atomic>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace hamelin::sweep {

/// How a sweep is run.
struct RunOptions {
  std::vector<std::string> command;  ///< what run_arguments() are appended to: the program and what begins its line
  std::size_t jobs = 1;              ///< processes at the same time
  std::string only;                  ///< runs whose id holds this; empty: all
  std::optional<std::size_t> limit;  ///< at most so many runs now
  bool fresh = false;                ///< drop the records that are there
  std::optional<double> timeout_s;   ///< of wall clock: a run that takes longer is killed
  std::vector<std::filesystem::path> plugin_directories;           ///< where the runs look for planners
  const std::atomic<bool>* stop = nullptr;                         ///< once set, children are told to end
  std::function<void(std::size_t done, std::size_t all)> on_done;  ///< after each record, of those to be run now
};

struct RunOutcome {
  std::size_t planned = 0;   ///< chosen by `only`
  std::size_t recorded = 0;  ///< of these, before
  std::size_t run = 0;       ///< of these, now
  std::size_t crashed = 0;   ///< of those run now
  bool dropped_cut_line = false;
  bool stopped = false;
};

/// Runs what has no record yet, each in a process and process group of its own, and appends a record each, flushed. A
/// run ends when its process does; what that process left running is killed. A run that crashes is recorded as
/// `crashed`, with its signal or exit code and its last line of standard error; so is one that is killed after
/// `timeout_s`. A child prints one line of JSON, {"result": …, "judge": …}, or exits with code 2 and one line that says
/// what is wrong with its input: then no other run is begun.
/// @throws Error io, parse or invalid (also for scenes, inputs or planners that are not what was planned); usage for 0
///         jobs; invalid, naming the run, for bad input found by a child
RunOutcome run_sweep(const std::filesystem::path& directory, const RunOptions& options);

}  // namespace hamelin::sweep

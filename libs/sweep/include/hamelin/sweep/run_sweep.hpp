#pragma once
#include <atomic>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/sweep/shard.hpp"

namespace hamelin::sweep {

/// Options for executing a plan.
struct RunOptions {
  std::vector<std::string> command;  ///< program and first arguments, followed by run_arguments()
  /// If given, a run does not start the program: it is a fork of this process that calls this with
  /// the whole command and ends with the exit code that it returns. For processes of one thread.
  std::function<int(const std::vector<std::string>& command)> main;
  std::size_t jobs = 1;        ///< number of concurrent processes
  std::string only;            ///< runs whose id contains this text; empty: all
  std::optional<Shard> shard;  ///< execute only the runs of this shard, into a file of its own
  std::optional<std::size_t> limit;  ///< largest number of runs to execute now
  bool fresh = false;                ///< drop existing records, also those of shards
  std::optional<double> timeout_s;   ///< wall-clock time after which a run is killed
  std::vector<std::filesystem::path> plugin_directories;  ///< where the runs search for planners
  /// Once set, the children are terminated, and killed if they have not ended 2 s later.
  const std::atomic<bool>* stop = nullptr;
  /// Called after each record, with the number of runs done and of all runs to be executed now.
  std::function<void(std::size_t done, std::size_t all)> on_done;
};

struct RunOutcome {
  std::size_t planned = 0;   ///< selected by `only` and `shard`
  std::size_t recorded = 0;  ///< of `planned`: recorded earlier
  std::size_t run = 0;       ///< of `planned`: executed now
  std::size_t crashed = 0;   ///< of `run`
  bool dropped_truncated_line = false;
  bool stopped = false;
};

/// Executes the runs that have no record yet, each in a process and process group of its own, and
/// appends a record for each, flushed. If this process is killed, the system kills the processes of
/// its runs; the calling thread must live until the return. A run ends when its process ends;
/// processes that it left running are killed. A run that crashes is recorded as `crashed`, with its
/// signal or exit code and its last line of standard error. The same holds for a run that is killed
/// after `timeout_s`. A run that another process interrupts or kills (SIGINT, SIGTERM, SIGHUP,
/// SIGKILL) is repeated once. Shards of one directory may run at the same time, on any number of
/// machines. A child prints one line of JSON, {"result": …, "judge": …}, or exits with code 2 and
/// one line that says what is wrong with its input; in that case no other run is started.
/// @throws Error io, parse or invalid (also for scenes, inputs or planners that have changed since
///         the plan); usage for 0 jobs, or a shard with `fresh`; invalid, with the id of the run,
///         for bad input found by a child
RunOutcome run_sweep(const std::filesystem::path& directory, const RunOptions& options);

}  // namespace hamelin::sweep

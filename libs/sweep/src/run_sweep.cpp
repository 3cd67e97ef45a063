#include <fmt/format.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <numeric>
#include <optional>
#include <set>

#include "child.hpp"
#include "file_lock.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/sweep/plan.hpp"
#include "hamelin/sweep/records.hpp"
#include "hamelin/sweep/run_sweep.hpp"
#include "hamelin/sweep/shard.hpp"

namespace hamelin::sweep {

namespace {

namespace fs = std::filesystem;

// How often children are checked for their end, and how often once one of them has closed its
// output.
constexpr int poll_ms = 100, poll_closed_ms = 1;
// How long children may take to end after SIGTERM, until they are killed.
constexpr std::chrono::seconds time_to_end(2);
// Exit code of a child that found bad input.
constexpr int bad_input = 2;
// Exit code of a child that was interrupted while its planner did not return.
constexpr int interrupted_hanging = 130;
// Length to which the last line of a child's standard error is truncated.
constexpr std::size_t line_max = 2000;

/// The file to which one process at a time appends records line by line.
class RecordFile {
 public:
  RecordFile(const fs::path& directory, const std::optional<Shard>& shard)
      : directory_(directory, shard ? FileLock::Mode::shared : FileLock::Mode::exclusive) {
    if (shard) shard_.emplace(records_file(directory, *shard), FileLock::Mode::exclusive, "shard");
  }

  /// Truncates the file to its first `bytes`; records are appended after them.
  void truncate(std::size_t bytes) {
    if (::ftruncate(file().descriptor(), static_cast<off_t>(bytes)) != 0 ||
        ::lseek(file().descriptor(), 0, SEEK_END) < 0)
      file().fail();
  }
  void append(const Json& record) {
    const std::string line = record.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
    for (std::size_t done = 0; done < line.size();) {
      const auto count = ::write(file().descriptor(), line.data() + done, line.size() - done);
      if (count < 0 && errno != EINTR) file().fail();
      if (count > 0) done += static_cast<std::size_t>(count);
    }
  }

  [[nodiscard]] fs::path path() const { return file().name(); }

 private:
  [[nodiscard]] const FileLock& file() const {
    return shard_ ? *shard_ : static_cast<const FileLock&>(directory_);
  }
  DirectoryLock directory_;
  std::optional<FileLock> shard_;
};

std::string last_line(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  const auto begin = text.rfind('\n');
  if (begin != std::string::npos) text = text.substr(begin + 1);
  constexpr std::string_view program = "hamelin: ";
  if (text.starts_with(program)) text = text.substr(program.size());
  return text.substr(0, line_max);
}

/// Executes a sweep.
class Sweep {
 public:
  Sweep(const fs::path& directory, const RunOptions& options)
      : directory_(directory),
        options_(options),
        plan_(read_plan(directory)),
        file_(directory, options.shard) {
    // It may have changed before the lock was held.
    if (sha256_of_file(plan_file(directory)) != plan_.sha256) plan_ = read_plan(directory);
  }

  RunOutcome run() {
    select_runs();
    file_.truncate(complete_bytes_);
    try {
      while (true) {
        if (stopping()) terminate_children();
        while (!stopping() && !failure_ && next_ < pending_.size() &&
               children_.size() < options_.jobs)
          start_next();
        if (children_.empty()) break;
        wait();
      }
    } catch (...) {  // for example if the disk is full: leave no child running
      for (const auto& child : children_) {
        child.signal_group(SIGKILL);
        (void)child.ended(true);
        (void)child.reap();
      }
      throw;
    }
    outcome_.stopped = stopping();
    if (failure_ && !outcome_.stopped) throw Error(*failure_);
    return outcome_;
  }

 private:
  [[nodiscard]] bool stopping() const { return options_.stop != nullptr && options_.stop->load(); }

  void select_runs() {
    const std::vector<bool> done = recorded_runs();
    std::vector<std::size_t> mine(plan_.runs.size());
    std::iota(mine.begin(), mine.end(), std::size_t{0});
    if (options_.shard) mine = runs_of_shard(plan_, *options_.shard);
    for (const std::size_t i : mine) {
      const PlannedRun& run = plan_.runs[i];
      if (!options_.only.empty() && run.id.find(options_.only) == std::string::npos) continue;
      ++outcome_.planned;
      if (done[i]) {
        ++outcome_.recorded;
      } else if (!options_.limit || pending_.size() < *options_.limit) {
        pending_.push_back(&run);
      }
    }
    selected_ = pending_.size();
    if (outcome_.planned == 0 && !options_.only.empty())
      throw Error(ErrorCode::usage,
                  fmt::format("{}: no run id contains '{}', expected a part of an id such as '{}'",
                              plan_file(directory_).string(), options_.only,
                              plan_.runs.empty() ? "" : plan_.runs.front().id));
    if (pending_.empty()) return;
    check_files(plan_, directory_, pending_);
    check_planners(plan_, options_.plugin_directories);
  }

  // Which runs have a record, in any file of the directory. With `fresh` all records are dropped.
  std::vector<bool> recorded_runs() {
    std::vector<bool> done(plan_.runs.size(), false);
    const RunIndex index(plan_);
    for (const auto& file : record_files(directory_)) {
      if (options_.fresh) {
        if (file != file_.path()) fs::remove(file);
      } else if (file == file_.path()) {
        const RecordsEnd end =
            read_records(file, index, [&](PlacedRecord&& record) { done[record.run] = true; });
        complete_bytes_ = end.complete_bytes;
        outcome_.dropped_truncated_line = end.truncated;
      } else {
        read_recorded_runs(file, index, [&](std::size_t run) { done[run] = true; });
      }
    }
    return done;
  }

  void start_next() {
    const PlannedRun& run = *pending_[next_++];
    std::vector<std::string> arguments = options_.command;
    const auto more = run_arguments(run, directory_);
    arguments.insert(arguments.end(), more.begin(), more.end());
    children_.emplace_back(run, arguments, options_.main);
  }

  // Asks children to end, and kills those that have not ended in time, for example because a
  // planner does not return.
  void terminate_children() {
    const auto now = std::chrono::steady_clock::now();
    const bool late = terminated_ && now - *terminated_ >= time_to_end;
    if (terminated_ && !late) return;
    if (!terminated_) terminated_ = now;
    for (const auto& child : children_) child.signal_group(late ? SIGKILL : SIGTERM);
  }

  void wait() {
    std::vector<pollfd> ends;
    bool any_closed = false;
    for (const auto& child : children_) {
      any_closed = any_closed || child.closed();
      for (const Pipe* pipe : {&child.out, &child.err})
        ends.push_back({pipe->open() ? pipe->reader() : -1, POLLIN, 0});
    }
    if (::poll(ends.data(), ends.size(), any_closed ? poll_closed_ms : poll_ms) < 0 &&
        errno != EINTR)
      throw Error(ErrorCode::io, fmt::format("cannot wait for runs: {}", std::strerror(errno)));
    if (options_.timeout_s) kill_timed_out();
    std::vector<Child> running;
    for (auto& child : children_) {
      const bool ended = child.ended(false);  // before reading, which then gets all output
      child.out.read();
      child.err.read();
      if (ended)
        finish(child);
      else
        running.push_back(std::move(child));
    }
    children_.swap(running);
  }

  void kill_timed_out() {
    const auto now = std::chrono::steady_clock::now();
    for (auto& child : children_) {
      if (child.timed_out ||
          std::chrono::duration<double>(now - child.started).count() <= *options_.timeout_s)
        continue;
      child.timed_out = true;
      child.signal_group(SIGKILL);
    }
  }

  void finish(const Child& child) {
    const int status = child.reap();
    if (stopping()) return;  // the child was terminated
    Json output = try_parse_json(child.out.text());
    const bool returned = WIFEXITED(status) && output.is_object() && output.contains("result") &&
                          output.contains("judge") && output["result"].is_object();
    const bool interrupted = returned
                                 ? output["result"].value("outcome", Json()) == "interrupted"
                                 : WIFEXITED(status) && WEXITSTATUS(status) == interrupted_hanging;
    if ((interrupted || killed_from_outside(child, status)) && repeated_.insert(child.run).second) {
      pending_.push_back(child.run);
      return;
    }
    const bool complete = returned && !interrupted;
    if (WIFEXITED(status) && WEXITSTATUS(status) == bad_input && !complete) {
      if (!failure_)
        failure_.emplace(ErrorCode::invalid,
                         fmt::format("run '{}': {}", child.run->id, last_line(child.err.text())));
      return;
    }
    Json record = empty_record(*child.run);
    if (complete)
      set_result(record, std::move(output));
    else
      set_crash(record, child, status);
    file_.append(record);
    ++outcome_.run;
    if (options_.on_done) options_.on_done(outcome_.run, selected_);
  }

  // Whether another process killed it, as a job scheduler does that ends a whole job: such a death
  // says nothing about the run, which is repeated once. Who kills the children of this process
  // often kills this process next.
  static bool killed_from_outside(const Child& child, int status) {
    if (!WIFSIGNALED(status) || child.timed_out) return false;
    const int signal = WTERMSIG(status);
    return signal == SIGKILL || signal == SIGTERM || signal == SIGINT || signal == SIGHUP;
  }

  [[nodiscard]] Json empty_record(const PlannedRun& run) const {
    Json labels = Json::object();
    for (const auto& [name, value] : run.labels) labels[name] = value;
    return {{"schema", "hamelin.record/1"},
            {"plan", plan_.sha256},
            {"id", run.id},
            {"labels", std::move(labels)},
            {"outcome", "crashed"},
            {"cause", nullptr},
            {"result", nullptr},
            {"judge", nullptr},
            {"crash", nullptr}};
  }

  static void set_result(Json& record, Json output) {
    const bool contact = output["judge"].is_object() && output["judge"].value("contact", false);
    record["outcome"] = contact ? Json("collision") : output["result"]["outcome"];
    record["cause"] = output["result"].value("cause", Json());
    record["result"] = std::move(output["result"]);
    record["judge"] = std::move(output["judge"]);
  }

  void set_crash(Json& record, const Child& child, int status) {
    const bool killed = WIFSIGNALED(status);
    const std::string cause =
        child.timed_out && killed ? fmt::format("killed after {} s", *options_.timeout_s)
        : killed ? fmt::format("signal {} ({})", WTERMSIG(status), ::strsignal(WTERMSIG(status)))
                 : fmt::format("exit code {}", WEXITSTATUS(status));
    const std::string line = last_line(child.err.text());
    record["cause"] = line.empty() ? cause : fmt::format("{}: {}", cause, line);
    record["crash"] = {{"signal", killed ? Json(WTERMSIG(status)) : Json(nullptr)},
                       {"exit_code", killed ? Json(nullptr) : Json(WEXITSTATUS(status))}};
    ++outcome_.crashed;
  }

  fs::path directory_;
  const RunOptions& options_;
  Plan plan_;
  RecordFile file_;
  std::vector<const PlannedRun*> pending_;
  std::set<const PlannedRun*> repeated_;  ///< after they were killed from outside
  std::size_t next_ = 0, selected_ = 0, complete_bytes_ = 0;
  std::vector<Child> children_;
  std::optional<Error> failure_;
  RunOutcome outcome_;
  std::optional<std::chrono::steady_clock::time_point> terminated_;  ///< when SIGTERM was sent
};

}  // namespace

RunOutcome run_sweep(const fs::path& directory, const RunOptions& options) {
  if (options.jobs == 0) throw Error(ErrorCode::usage, "0 jobs, expected at least 1");
  if (options.fresh && options.shard)
    throw Error(ErrorCode::usage,
                "a shard cannot drop the records of all shards, expected a run without a shard");
  return Sweep(directory, options).run();
}

}  // namespace hamelin::sweep

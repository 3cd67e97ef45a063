#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <set>

#include "directory_lock.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/sweep/plan.hpp"
#include "hamelin/sweep/run_sweep.hpp"

namespace hamelin::sweep {

namespace {

namespace fs = std::filesystem;

// Processes are asked whether they have ended so often, and more often once they have closed their output.
constexpr int poll_ms = 100, poll_closed_ms = 1, bad_input = 2;
// A child's last line of standard error is cut to this.
constexpr std::size_t line_max = 2000;

std::string reason() {
  return std::strerror(errno);
}

/// A pipe of which the writing end goes to a child.
class Pipe {
 public:
  Pipe() {
    // reading never waits: a process that the run left behind may hold the other end open
    if (::pipe2(ends_.data(), O_CLOEXEC) != 0 || ::fcntl(ends_[0], F_SETFL, O_NONBLOCK) != 0)
      throw Error(ErrorCode::io, fmt::format("no pipe: {}", reason()));
  }
  ~Pipe() {
    close(0);
    close(1);
  }
  Pipe(Pipe&& other) noexcept : ends_(other.ends_), text(std::move(other.text)) { other.ends_ = {-1, -1}; }
  Pipe& operator=(Pipe&&) = delete;

  [[nodiscard]] int reader() const noexcept { return ends_[0]; }
  [[nodiscard]] int writer() const noexcept { return ends_[1]; }
  void close_writer() noexcept { close(1); }
  [[nodiscard]] bool open() const noexcept { return ends_[0] >= 0; }
  /// Takes what is there, at least all that one pipe holds; closes at the end of it.
  void read() {
    std::array<char, 16384> buffer{};
    for (int i = 0; i < 8 && open(); ++i) {
      const auto count = ::read(ends_[0], buffer.data(), buffer.size());
      if (count > 0)
        text.append(buffer.data(), static_cast<std::size_t>(count));
      else if (count == 0 || (errno != EINTR && errno != EAGAIN))
        close(0);
      else if (errno == EAGAIN)
        return;
    }
  }

 private:
  void close(std::size_t end) noexcept {
    if (ends_[end] >= 0) ::close(ends_[end]);
    ends_[end] = -1;
  }
  std::array<int, 2> ends_{-1, -1};

 public:
  std::string text;
};

/// A run under way, in a process group of its own.
struct Child {
  const PlannedRun* run;
  pid_t pid = -1;
  std::chrono::steady_clock::time_point begun = std::chrono::steady_clock::now();
  bool too_long = false;  ///< and killed for it
  Pipe out, err;

  explicit Child(const PlannedRun& of) : run(&of) {}
  [[nodiscard]] bool closed() const noexcept { return !out.open() && !err.open(); }
  /// The process and all that it started and that stayed in its group.
  void signal_group(int signal) const noexcept { ::kill(-pid, signal); }
  /// Whether the process has ended. It stays a zombie, so that no other takes its id.
  [[nodiscard]] bool ended(bool wait) const noexcept {
    siginfo_t about{};
    const int options = WEXITED | WNOWAIT | (wait ? 0 : WNOHANG);
    int failed = 0;
    while ((failed = ::waitid(P_PID, static_cast<id_t>(pid), &about, options)) != 0 && errno == EINTR) {
    }
    return failed != 0 || about.si_pid == pid;
  }
  /// Ends what the process left running and gives its status. After ended().
  [[nodiscard]] int reap() const noexcept {
    signal_group(SIGKILL);
    int status = 0;
    while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
    }
    return status;
  }
};

void spawn(Child& child, const std::vector<std::string>& words) {
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (const auto& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, child.out.writer(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, child.err.writer(), STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);  // group 0: one of its own
  const int failed = ::posix_spawn(&child.pid, argv[0], &actions, &attributes, argv.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0)
    throw Error(ErrorCode::io, fmt::format("{}: cannot be started: {}", words.front(), std::strerror(failed)));
  child.out.close_writer();
  child.err.close_writer();
}

/// The file of records, appended to a line at a time, by one sweep at a time.
class RecordFile {
 public:
  explicit RecordFile(const fs::path& directory) : lock_(directory) {}

  /// Drops what follows the first `bytes`; what is appended comes after them.
  void keep(std::size_t bytes) {
    if (::ftruncate(lock_.descriptor(), static_cast<off_t>(bytes)) != 0 || ::lseek(lock_.descriptor(), 0, SEEK_END) < 0)
      lock_.fail();
  }
  void append(const Json& record) {
    const std::string line = record.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
    for (std::size_t done = 0; done < line.size();) {
      const auto count = ::write(lock_.descriptor(), line.data() + done, line.size() - done);
      if (count < 0 && errno != EINTR) lock_.fail();
      if (count > 0) done += static_cast<std::size_t>(count);
    }
  }

 private:
  DirectoryLock lock_;
};

std::string last_line(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  const auto begin = text.rfind('\n');
  if (begin != std::string::npos) text = text.substr(begin + 1);
  constexpr std::string_view program = "hamelin: ";
  if (text.starts_with(program)) text = text.substr(program.size());
  return text.substr(0, line_max);
}

/// The sweep while it runs.
class Sweep {
 public:
  Sweep(const fs::path& directory, const RunOptions& options)
      : directory_(directory), options_(options), plan_(read_plan(directory)), file_(directory) {
    plan_ = read_plan(directory);  // as it is now that no other process may write it
  }

  RunOutcome run() {
    choose();
    file_.keep(keep_bytes_);
    try {
      while (true) {
        if (stopping()) ask_children_to_end();
        while (!stopping() && !failure_ && next_ < todo_.size() && children_.size() < options_.jobs) begin_next();
        if (children_.empty()) break;
        wait();
      }
    } catch (...) {  // the disk is full or no process to be had: nothing is left running
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

  void choose() {
    std::set<std::string> done;
    if (!options_.fresh) {
      const Records records = read_records(directory_, plan_);
      for (const auto& record : records.lines) done.insert(record["id"].get<std::string>());
      keep_bytes_ = records.good_bytes;
      outcome_.dropped_cut_line = records.cut;
    }
    for (const auto& run : plan_.runs) {
      if (!options_.only.empty() && run.id.find(options_.only) == std::string::npos) continue;
      ++outcome_.planned;
      if (done.contains(run.id)) {
        ++outcome_.recorded;
      } else if (!options_.limit || todo_.size() < *options_.limit) {
        todo_.push_back(&run);
      }
    }
    if (outcome_.planned == 0)
      throw Error(ErrorCode::usage, fmt::format("{}: no run's id holds '{}', expected a part of one as '{}'",
                                                plan_file(directory_).string(), options_.only,
                                                plan_.runs.empty() ? "" : plan_.runs.front().id));
    if (!todo_.empty()) check_unchanged(plan_, directory_, options_.plugin_directories);
  }

  void begin_next() {
    const PlannedRun& run = *todo_[next_++];
    std::vector<std::string> words = options_.command;
    const auto more = run_arguments(run, directory_);
    words.insert(words.end(), more.begin(), more.end());
    Child child(run);
    spawn(child, words);
    children_.push_back(std::move(child));
  }

  void ask_children_to_end() {
    if (asked_to_end_) return;
    asked_to_end_ = true;
    for (const auto& child : children_) child.signal_group(SIGTERM);
  }

  void wait() {
    std::vector<pollfd> ends;
    bool any_closed = false;
    for (const auto& child : children_) {
      any_closed = any_closed || child.closed();
      for (const Pipe* pipe : {&child.out, &child.err}) ends.push_back({pipe->open() ? pipe->reader() : -1, POLLIN, 0});
    }
    if (::poll(ends.data(), ends.size(), any_closed ? poll_closed_ms : poll_ms) < 0 && errno != EINTR)
      throw Error(ErrorCode::io, fmt::format("cannot wait for runs: {}", reason()));
    if (options_.timeout_s) kill_too_long();
    std::vector<Child> running;
    for (auto& child : children_) {
      const bool ended = child.ended(false);  // before reading, so that nothing it wrote is missed
      child.out.read();
      child.err.read();
      if (ended)
        end(child);
      else
        running.push_back(std::move(child));
    }
    children_.swap(running);
  }

  void kill_too_long() {
    const auto now = std::chrono::steady_clock::now();
    for (auto& child : children_) {
      if (child.too_long || std::chrono::duration<double>(now - child.begun).count() <= *options_.timeout_s) continue;
      child.too_long = true;
      child.signal_group(SIGKILL);
    }
  }

  void end(const Child& child) {
    const int status = child.reap();
    if (stopping()) return;  // it was told to end
    Json answer = Json::parse(child.out.text, nullptr, false);
    const bool whole = WIFEXITED(status) && answer.is_object() && answer.contains("result") &&
                       answer.contains("judge") && answer["result"].is_object() &&
                       answer["result"].value("outcome", Json()) != "interrupted";
    if (WIFEXITED(status) && WEXITSTATUS(status) == bad_input && !whole) {
      if (!failure_)
        failure_.emplace(ErrorCode::invalid, fmt::format("run '{}': {}", child.run->id, last_line(child.err.text)));
      return;
    }
    Json record = empty_record(*child.run);
    if (whole)
      set_result(record, std::move(answer));
    else
      set_crash(record, child, status);
    file_.append(record);
    ++outcome_.run;
    if (options_.on_done) options_.on_done(outcome_.run, todo_.size());
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

  static void set_result(Json& record, Json answer) {
    const bool contact = answer["judge"].is_object() && answer["judge"].value("contact", false);
    record["outcome"] = contact ? Json("collision") : answer["result"]["outcome"];
    record["cause"] = answer["result"].value("cause", Json());
    record["result"] = std::move(answer["result"]);
    record["judge"] = std::move(answer["judge"]);
  }

  void set_crash(Json& record, const Child& child, int status) {
    const bool killed = WIFSIGNALED(status);
    const std::string how = child.too_long && killed ? fmt::format("killed after {} s", *options_.timeout_s)
                            : killed ? fmt::format("signal {} ({})", WTERMSIG(status), ::strsignal(WTERMSIG(status)))
                                     : fmt::format("exit code {}", WEXITSTATUS(status));
    const std::string line = last_line(child.err.text);
    record["cause"] = line.empty() ? how : fmt::format("{}: {}", how, line);
    record["crash"] = {{"signal", killed ? Json(WTERMSIG(status)) : Json(nullptr)},
                       {"exit_code", killed ? Json(nullptr) : Json(WEXITSTATUS(status))}};
    ++outcome_.crashed;
  }

  fs::path directory_;
  const RunOptions& options_;
  Plan plan_;
  RecordFile file_;
  std::vector<const PlannedRun*> todo_;
  std::size_t next_ = 0, keep_bytes_ = 0;
  std::vector<Child> children_;
  std::optional<Error> failure_;
  RunOutcome outcome_;
  bool asked_to_end_ = false;
};

}  // namespace

RunOutcome run_sweep(const fs::path& directory, const RunOptions& options) {
  if (options.jobs == 0) throw Error(ErrorCode::usage, "0 jobs, expected at least 1");
  return Sweep(directory, options).run();
}

}  // namespace hamelin::sweep

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

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/study/sweep.hpp"

namespace hamelin::study {

namespace {

namespace fs = std::filesystem;

constexpr int poll_ms = 100, bad_input = 2;
// A child's last words are cut to this.
constexpr std::size_t words_max = 2000;

std::string reason() {
  return std::strerror(errno);
}

/// A pipe of which the writing end goes to a child.
class Pipe {
 public:
  Pipe() {
    if (::pipe2(ends_.data(), O_CLOEXEC) != 0) throw Error(ErrorCode::io, fmt::format("no pipe: {}", reason()));
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
  /// Takes what is there; closes at the end of it.
  void read() {
    std::array<char, 16384> buffer{};
    const auto count = ::read(ends_[0], buffer.data(), buffer.size());
    if (count > 0)
      text.append(buffer.data(), static_cast<std::size_t>(count));
    else if (count == 0 || (errno != EINTR && errno != EAGAIN))
      close(0);
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

/// A run under way.
struct Child {
  const SweepRun* run;
  pid_t pid = -1;
  std::chrono::steady_clock::time_point begun = std::chrono::steady_clock::now();
  bool too_long = false;  ///< and killed for it
  Pipe out, err;

  explicit Child(const SweepRun& of) : run(&of) {}
  [[nodiscard]] bool open() const noexcept { return out.open() || err.open(); }
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
  const int failed = ::posix_spawn(&child.pid, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0)
    throw Error(ErrorCode::io, fmt::format("{}: cannot be started: {}", words.front(), std::strerror(failed)));
  child.out.close_writer();
  child.err.close_writer();
}

/// The file of records, appended to a line at a time, by one sweep at a time.
class RecordFile {
 public:
  explicit RecordFile(const fs::path& file)
      : name_(file.string()), fd_(::open(name_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666)) {
    if (fd_ < 0) fail();
    if (::flock(fd_, LOCK_EX | LOCK_NB) == 0) return;
    const bool taken = errno == EWOULDBLOCK;
    if (!taken) fail();
    ::close(fd_);
    throw Error(ErrorCode::io,
                fmt::format("{}: another sweep is writing it, expected one at a time in a directory", name_));
  }
  ~RecordFile() {
    if (fd_ >= 0) ::close(fd_);
  }
  RecordFile(const RecordFile&) = delete;
  RecordFile& operator=(const RecordFile&) = delete;

  /// Drops what follows the first `bytes`; what is appended comes after them.
  void keep(std::size_t bytes) {
    if (::ftruncate(fd_, static_cast<off_t>(bytes)) != 0 || ::lseek(fd_, 0, SEEK_END) < 0) fail();
  }
  void append(const Json& record) {
    const std::string line = record.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
    for (std::size_t done = 0; done < line.size();) {
      const auto count = ::write(fd_, line.data() + done, line.size() - done);
      if (count < 0 && errno != EINTR) fail();
      if (count > 0) done += static_cast<std::size_t>(count);
    }
  }

 private:
  [[noreturn]] void fail() const {
    throw Error(ErrorCode::io, fmt::format("{}: cannot be written: {}", name_, reason()));
  }
  std::string name_;
  int fd_;
};

std::string last_words(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  const auto begin = text.rfind('\n');
  if (begin != std::string::npos) text = text.substr(begin + 1);
  constexpr std::string_view program = "hamelin: ";
  if (text.starts_with(program)) text = text.substr(program.size());
  return text.substr(0, words_max);
}

/// The sweep while it runs.
class Sweep {
 public:
  Sweep(const fs::path& directory, const SweepOptions& options)
      : directory_(directory), options_(options), plan_(read_plan(directory)), file_(records_file(directory)) {}

  SweepOutcome run() {
    choose();
    file_.keep(keep_bytes_);
    try {
      while (true) {
        if (stopping()) tell_children();
        while (!stopping() && !failure_ && next_ < todo_.size() && children_.size() < options_.jobs) begin_next();
        if (children_.empty()) break;
        wait();
      }
    } catch (...) {  // the disk is full or no process to be had: nothing is left running
      tell_children();
      for (const auto& child : children_) ::waitpid(child.pid, nullptr, 0);
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
    std::set<std::string> scenes;
    for (const auto& run : plan_.runs) {
      if (!options_.only.empty() && run.id.find(options_.only) == std::string::npos) continue;
      ++outcome_.planned;
      if (done.contains(run.id)) {
        ++outcome_.recorded;
      } else if (!options_.limit || todo_.size() < *options_.limit) {
        todo_.push_back(&run);
        scenes.insert(run.scene);
      }
    }
    if (outcome_.planned == 0)
      throw Error(ErrorCode::usage, fmt::format("{}: no run's id holds '{}', expected a part of one as '{}'",
                                                plan_file(directory_).string(), options_.only,
                                                plan_.runs.empty() ? "" : plan_.runs.front().id));
    for (const auto& scene : plan_.scenes)
      if (scenes.contains(scene.file) && sha256_hex(read_file(directory_ / scene.file)) != scene.sha256)
        throw Error(ErrorCode::invalid,
                    fmt::format("{}: is not what was planned, expected the scene unchanged; plan anew",
                                (directory_ / scene.file).string()));
  }

  void begin_next() {
    const SweepRun& run = *todo_[next_++];
    std::vector<std::string> words = options_.command;
    const auto more = run_arguments(run, directory_);
    words.insert(words.end(), more.begin(), more.end());
    Child child(run);
    spawn(child, words);
    children_.push_back(std::move(child));
  }

  void tell_children() {
    if (told_) return;
    told_ = true;
    for (const auto& child : children_) ::kill(child.pid, SIGTERM);
  }

  void wait() {
    std::vector<pollfd> ends;
    for (const auto& child : children_)
      for (const Pipe* pipe : {&child.out, &child.err}) ends.push_back({pipe->open() ? pipe->reader() : -1, POLLIN, 0});
    if (::poll(ends.data(), ends.size(), poll_ms) < 0 && errno != EINTR)
      throw Error(ErrorCode::io, fmt::format("cannot wait for runs: {}", reason()));
    for (std::size_t i = 0; i < children_.size(); ++i) {
      if (ends[2 * i].revents != 0) children_[i].out.read();
      if (ends[2 * i + 1].revents != 0) children_[i].err.read();
    }
    if (options_.timeout_s) kill_too_long();
    std::vector<Child> open;
    for (auto& child : children_)
      if (child.open())
        open.push_back(std::move(child));
      else
        end(child);
    children_.swap(open);
  }

  void kill_too_long() {
    const auto now = std::chrono::steady_clock::now();
    for (auto& child : children_) {
      if (child.too_long || std::chrono::duration<double>(now - child.begun).count() <= *options_.timeout_s) continue;
      child.too_long = true;
      ::kill(child.pid, SIGKILL);
    }
  }

  void end(const Child& child) {
    int status = 0;
    while (::waitpid(child.pid, &status, 0) < 0 && errno == EINTR) {
    }
    if (stopping()) return;  // told to end, or by the same Ctrl-C
    const std::string words = last_words(child.err.text);
    Json said = Json::parse(child.out.text, nullptr, false);
    const bool whole = WIFEXITED(status) && said.is_object() && said.contains("result") && said.contains("judge") &&
                       said["result"].is_object() && said["result"].value("outcome", Json()) != "interrupted";
    if (WIFEXITED(status) && WEXITSTATUS(status) == bad_input && !whole) {
      if (!failure_) failure_.emplace(ErrorCode::invalid, fmt::format("run '{}': {}", child.run->id, words));
      return;
    }
    Json labels = Json::object();
    for (const auto& [name, value] : child.run->labels) labels[name] = value;
    Json record{{"schema", "hamelin.record/1"},
                {"plan", plan_.sha256},
                {"id", child.run->id},
                {"labels", std::move(labels)},
                {"outcome", "crashed"},
                {"cause", nullptr},
                {"result", nullptr},
                {"judge", nullptr},
                {"crash", nullptr}};
    if (whole) {
      const bool contact = said["judge"].is_object() && said["judge"].value("contact", false);
      record["outcome"] = contact ? Json("collision") : said["result"]["outcome"];
      record["cause"] = said["result"].value("cause", Json());
      record["result"] = std::move(said["result"]);
      record["judge"] = std::move(said["judge"]);
    } else {
      const bool killed = WIFSIGNALED(status);
      const std::string how = child.too_long && killed ? fmt::format("killed after {} s", *options_.timeout_s)
                              : killed ? fmt::format("signal {} ({})", WTERMSIG(status), ::strsignal(WTERMSIG(status)))
                                       : fmt::format("exit code {}", WEXITSTATUS(status));
      record["cause"] = words.empty() ? how : fmt::format("{}: {}", how, words);
      record["crash"] = {{"signal", killed ? Json(WTERMSIG(status)) : Json(nullptr)},
                         {"exit_code", killed ? Json(nullptr) : Json(WEXITSTATUS(status))}};
      ++outcome_.crashed;
    }
    file_.append(record);
    ++outcome_.run;
    if (options_.on_done) options_.on_done(outcome_.run, todo_.size());
  }

  fs::path directory_;
  const SweepOptions& options_;
  SweepPlan plan_;
  RecordFile file_;
  std::vector<const SweepRun*> todo_;
  std::size_t next_ = 0, keep_bytes_ = 0;
  std::vector<Child> children_;
  std::optional<Error> failure_;
  SweepOutcome outcome_;
  bool told_ = false;
};

}  // namespace

SweepOutcome run_sweep(const fs::path& directory, const SweepOptions& options) {
  if (options.jobs == 0) throw Error(ErrorCode::usage, "0 jobs, expected at least 1");
  return Sweep(directory, options).run();
}

}  // namespace hamelin::study

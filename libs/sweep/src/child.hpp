#pragma once
#include <sys/types.h>

#include <array>
#include <chrono>
#include <string>
#include <vector>

#include "hamelin/sweep/plan.hpp"
#include "hamelin/sweep/run_sweep.hpp"

namespace hamelin::sweep {

/// A pipe whose writing end goes to a child.
class Pipe {
 public:
  /// @throws Error io
  Pipe();
  ~Pipe();
  Pipe(Pipe&& other) noexcept;
  Pipe& operator=(Pipe&&) = delete;

  [[nodiscard]] int reader() const noexcept { return ends_[0]; }
  [[nodiscard]] int writer() const noexcept { return ends_[1]; }
  void close_writer() noexcept { close(1); }
  [[nodiscard]] bool open() const noexcept { return ends_[0] >= 0; }
  /// Reads the available data, at least as much as a pipe holds; closes the pipe at the end of the
  /// data.
  void read();
  [[nodiscard]] const std::string& text() const noexcept { return text_; }

 private:
  void close(std::size_t end) noexcept;

  std::array<int, 2> ends_{-1, -1};
  std::string text_;
};

using Main = decltype(RunOptions::main);

/// A run in progress, in a process group of its own. Its standard input is empty.
struct Child {
  /// Starts a program, or calls `main`, as RunOptions says. @throws Error io
  Child(const PlannedRun& of, const std::vector<std::string>& command, const Main& main);

  [[nodiscard]] bool closed() const noexcept { return !out.open() && !err.open(); }
  /// Signals the process and all processes that it started and that stayed in its group.
  void signal_group(int signal) const noexcept;
  /// Whether the process has ended. It remains a zombie, which keeps its id reserved until reap().
  [[nodiscard]] bool ended(bool wait) const noexcept;
  /// Kills the processes that the process left running and returns its status. To be called after
  /// ended().
  [[nodiscard]] int reap() const noexcept;

  const PlannedRun* run;
  std::chrono::steady_clock::time_point started = std::chrono::steady_clock::now();
  bool timed_out = false;  ///< and was killed for it
  Pipe out, err;
  pid_t pid = -1;
};

}  // namespace hamelin::sweep

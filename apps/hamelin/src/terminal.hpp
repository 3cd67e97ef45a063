#pragma once
#include <atomic>
#include <memory>
#include <string>
#include <string_view>

/// Messages, colour, progress and signals. Data goes to stdout, messages and progress go to stderr.
namespace spdlog {
class logger;
}

namespace hamelin::app {

/// How much is printed: `quiet` prints errors but no notes, progress or reports; `verbose` also
/// prints details. Requested data, such as the output of --json, is always printed.
enum class Verbosity { quiet, normal, verbose };
void set_verbosity(Verbosity verbosity);

/// The logger behind all messages, to be handed to libraries. Errors are printed as they are,
/// warnings and notes with the prefix "warning: " or "note: ", details only if verbose.
[[nodiscard]] std::shared_ptr<spdlog::logger> diagnostics();

/// "hamelin: text", one line on stderr.
void error_line(std::string_view text);
/// "hamelin: note: text", one line on stderr, unless quiet.
void note(std::string_view text);
/// "hamelin: text", one line on stderr if verbose: files read, directories searched, times taken.
void detail(std::string_view text);
/// Prints the readable report of a command on stdout, unless quiet.
void report(std::string_view text);

/// Measures the wall-clock time of its lifetime and prints it if verbose. No result depends on it.
class Phase {
 public:
  /// @param name e.g. "reading the map"
  explicit Phase(std::string_view name);
  ~Phase();
  Phase(const Phase&) = delete;
  Phase& operator=(const Phase&) = delete;

 private:
  std::string name_;
  double begin_s_;
};

enum class Colour { none, good, fair, bad };
/// Disables colour.
void set_no_colour();
/// The text, coloured if stdout is a terminal and --no-color, NO_COLOR and TERM=dumb are not set.
[[nodiscard]] std::string coloured(std::string_view text, Colour colour);

/// Progress of a long command on stderr: a line that is updated in place on a terminal, and a new
/// line every 10 s elsewhere and on a dumb terminal. Prints nothing if quiet.
class Progress {
 public:
  /// @param unit text after the numbers, e.g. "s simulated"
  explicit Progress(std::string unit = "s simulated");
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void show(double done, double all);

 private:
  std::string unit_;
  bool in_place_;  ///< whether one line is updated
  bool shown_ = false;
  double last_shown_s_;
};

/// Makes SIGINT and SIGTERM set the returned flag, so that logs are closed properly. A second
/// signal ends the program.
[[nodiscard]] const std::atomic<bool>& stop_on_signals();

/// For code that calls planners, which may not return: if such a signal comes while an object of
/// this class lives, and the object still lives 2 s later, the program prints one line and ends
/// with exit code 130, without finishing its log. At most one object may live at a time.
class HangGuard {
 public:
  HangGuard() noexcept;
  ~HangGuard();
  HangGuard(const HangGuard&) = delete;
  HangGuard& operator=(const HangGuard&) = delete;
};

}  // namespace hamelin::app

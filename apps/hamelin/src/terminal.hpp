#pragma once
#include <atomic>
#include <memory>
#include <string>
#include <string_view>

/// Messages, colour, progress and signals. Data goes to stdout; all of this to stderr.
namespace spdlog {
class logger;
}

namespace hamelin::app {

/// How much is said: under `quiet` errors alone, no notes, no progress and no report; under `verbose` details too.
/// Data that a command is asked for, --json included, is printed under each.
enum class Loudness { quiet, normal, verbose };
void set_loudness(Loudness loudness);

/// What all of this goes through, for libraries that have something to say: errors as they are, warnings and notes with
/// "warning: " and "note: " in front, details under verbose.
[[nodiscard]] std::shared_ptr<spdlog::logger> diagnostics();

/// "hamelin: text", one line on stderr.
void error_line(std::string_view text);
/// "hamelin: note: text", one line on stderr; not under quiet.
void note(std::string_view text);
/// "hamelin: text", one line on stderr under verbose: what is read, where is looked, what takes how long.
void detail(std::string_view text);
/// What a command did, for a reader, on stdout as it is; not under quiet.
void report(std::string_view text);

/// Tells under verbose how long it lived (wall clock; no result depends on it).
class Phase {
 public:
  /// @param what e.g. "reading the map"
  explicit Phase(std::string_view what);
  ~Phase();
  Phase(const Phase&) = delete;
  Phase& operator=(const Phase&) = delete;

 private:
  std::string what_;
  double begin_s_;
};

enum class Colour { none, good, fair, bad };
/// No colour from now on.
void set_no_colour();
/// The text, coloured if stdout is a terminal that wants it (--no-color, NO_COLOR, TERM=dumb).
[[nodiscard]] std::string coloured(std::string_view text, Colour colour);

/// How far something is. On a terminal a line on stderr that counts up while this lives; elsewhere (and on a dumb
/// terminal) a line each 10 s. Nothing under quiet.
class Progress {
 public:
  /// @param what follows the numbers, e.g. "s simulated"
  explicit Progress(std::string what = "s simulated");
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void show(double done, double all);

 private:
  std::string what_;
  bool counting_;  ///< on one line, over and over
  bool shown_ = false;
  double last_shown_s_;
};

/// From now on SIGINT and SIGTERM set the flag returned, so that a record ends properly; a second one ends the program.
[[nodiscard]] const std::atomic<bool>& stop_on_signals();

}  // namespace hamelin::app

#pragma once
#include <atomic>
#include <string>
#include <string_view>

/// Messages, colour, progress and signals. Data goes to stdout; all of this to stderr.
namespace hamelin::app {

/// "hamelin: text", one line on stderr.
void error_line(std::string_view text);
/// "hamelin: note: text", one line on stderr.
void note(std::string_view text);

enum class Colour { none, good, fair, bad };
/// The text, coloured if stdout is a terminal that wants it (NO_COLOR, TERM).
[[nodiscard]] std::string coloured(std::string_view text, Colour colour);

/// A line on stderr that counts up while it lives; nothing unless stderr is a terminal.
class Progress {
 public:
  Progress();
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void show(double time_s, double duration_s);

 private:
  bool terminal_;
  bool shown_ = false;
  double last_shown_s_ = 0.0;
};

/// From now on SIGINT and SIGTERM set the flag returned, so that a record ends properly; a second one ends the program.
[[nodiscard]] const std::atomic<bool>& stop_on_signals();

}  // namespace hamelin::app

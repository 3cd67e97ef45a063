#pragma once
#include <fstream>
#include <functional>
#include <istream>
#include <memory>
#include <optional>
#include <string>

#include "hamelin/control/controller.hpp"
#include "loop/target_line.hpp"

namespace hamelin::simulation {

/// Reads a stream of targets, one JSON object per line, and passes each line on when its time has
/// come. What a line says depends on its time alone, so a run repeats however fast the stream is.
class TargetFeed {
 public:
  /// @param stream must outlive this @param name for messages
  TargetFeed(std::istream& stream, std::string name, bool position_only);
  /// Reads from a file. @throws Error io if it cannot be opened
  TargetFeed(const std::filesystem::path& file, bool position_only);

  /// Passes on all lines up to a time. It waits for the line after them.
  /// @param refused receives one line of text for each line that is refused
  void advance(double time_s, control::Controller& controller,
               const std::function<void(const std::string&)>& refused);
  /// Whether all lines were passed on.
  [[nodiscard]] bool ended() const noexcept { return ended_; }
  /// The time of the last line that was passed on; none before the first.
  [[nodiscard]] std::optional<double> last_s() const noexcept { return last_s_; }

 private:
  /// Reads lines until one is right.
  void read_next(const std::function<void(const std::string&)>& refused);

  std::unique_ptr<std::ifstream> file_;
  std::istream& stream_;
  std::string name_;
  bool position_only_;
  long line_ = 0;
  std::optional<control::TargetSample> next_;  ///< the line after those that were passed on
  long next_line_ = 0;
  bool ended_ = false;
  std::optional<double> last_s_;
};

}  // namespace hamelin::simulation

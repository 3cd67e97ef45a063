#pragma once
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "hamelin/core/json.hpp"

namespace hamelin::log {

/// A JSON Lines record of one run (schema hamelin.run/1): header, ticks, events, last a result. Lines are appended in
/// place and flushed one by one, so a crash loses at most the current line. The file is made with the first line: a run
/// that is refused before it begins leaves nothing behind.
class RunLog {
 public:
  /// @throws Error io if the file cannot be written; tried at once, without touching what stands there
  explicit RunLog(const std::filesystem::path& file);
  /// Writes {"type": type, ...fields}; a header is given its "schema". Non-finite numbers are written as null and told
  /// in an event after the line.
  /// @throws Error io if the disk refuses
  void write(const char* type, const Json& fields);
  [[nodiscard]] const std::filesystem::path& file() const noexcept { return file_; }

 private:
  void append(const Json& line);

  std::filesystem::path file_;
  std::ofstream out_;
};

/// Checks that a file can be written, before long work begins. An absent file is made and removed again, an existing
/// one opened and left as it is.
/// @throws Error io, naming the file and the system's reason
void check_writable(const std::filesystem::path& file);

/// Replaces every non-finite number by null.
/// @return what was replaced, e.g. "/q/0 is nan"
std::vector<std::string> null_non_finite(Json& document);

/// The whole lines of a log.
struct LogLines {
  std::vector<Json> lines;
  bool cut = false;  ///< whether the last line had no end, as after a crash; it is left out then
};

/// @throws Error io; parse: "file: line N: …" for a whole line that is not a JSON object
[[nodiscard]] LogLines read_log(const std::filesystem::path& file);

/// What check_log found.
struct LogSummary {
  std::size_t ticks = 0, events = 0;
  bool cut = false, has_result = false;
};

/// Reads a log and checks it: a header first, then ticks in order and events, at most one result and nothing behind it,
/// each line by its schema. A log without result, or with a cut last line, is one of an unfinished run, and fine.
/// @throws Error io, parse or invalid, naming the line
LogSummary check_log(const std::filesystem::path& file);

}  // namespace hamelin::log

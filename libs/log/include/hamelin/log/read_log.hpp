#pragma once
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/io/json.hpp"

namespace hamelin::log {

/// Reads a log line by line, plain or zstd (recognized by its first bytes), and keeps at most one
/// line or frame in memory. An incomplete line or frame at the end, as a crash leaves it, is
/// skipped.
class LogReader {
 public:
  /// @throws Error io
  explicit LogReader(const std::filesystem::path& file);
  ~LogReader();
  LogReader(const LogReader&) = delete;
  LogReader& operator=(const LogReader&) = delete;

  /// Reads the next complete line.
  /// @return false at the end
  /// @throws Error parse: "file: line N: …" for a complete line that is not a JSON object, "file:
  /// frame N at byte B: …" for a frame that is damaged or that decompresses to more than 200 times
  /// its size
  bool next(Json& line);
  /// Reads the next complete line as text, unparsed; valid until the next call.
  bool next_text(std::string_view& line);
  /// Number of lines read so far.
  [[nodiscard]] std::size_t lines() const noexcept { return lines_; }
  /// Whether the file ended in the middle of a line or frame; known once next() returned false.
  [[nodiscard]] bool cut() const noexcept { return cut_; }
  /// "file: line N" of the last line read.
  [[nodiscard]] std::string where() const;

 private:
  struct Decompressor;

  /// Appends to text_. @return false at the end of the file
  bool read_more();

  std::filesystem::path file_;
  std::ifstream in_;
  std::unique_ptr<Decompressor> decompressor_;
  std::string text_;
  std::size_t at_ = 0, lines_ = 0;
  bool cut_ = false;
};

/// The complete lines of a log.
struct LogLines {
  std::vector<Json> lines;
  bool cut = false;  ///< see LogReader::cut
};

/// Reads all lines at once. @throws Error as LogReader does
[[nodiscard]] LogLines read_log(const std::filesystem::path& file);

/// Contents of a log that check_log accepted.
struct LogSummary {
  std::size_t ticks = 0, events = 0;
  bool cut = false, has_result = false;
};

/// Reads a log and checks it: first a header, then ticks in order and events, at most one result
/// and nothing after it, each line against its schema. A log without a result or with an incomplete
/// end belongs to an unfinished run and is valid.
/// @throws Error io, parse or invalid, naming the line
LogSummary check_log(const std::filesystem::path& file);

/// Checks one line against the schema of its type. @throws Error invalid, beginning with `where`
void check_line(const Json& line, const std::string& where);

}  // namespace hamelin::log

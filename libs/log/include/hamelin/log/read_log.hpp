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

/// Reads a log line by line, plain or zstd (told apart by the first bytes), holding no more than one line or frame.
/// What a crash cut off at the end is left out: half a line, or half a frame.
class LogReader {
 public:
  /// @throws Error io
  explicit LogReader(const std::filesystem::path& file);
  ~LogReader();
  LogReader(const LogReader&) = delete;
  LogReader& operator=(const LogReader&) = delete;

  /// The next whole line.
  /// @return false at the end
  /// @throws Error parse: "file: line N: …" for a whole line that is not a JSON object, "file: frame N at byte B: …"
  /// for a frame that is damaged, or that unpacks to more than 200 times its size as no log does
  bool next(Json& line);
  /// The same as text, not looked at; valid up to the next call.
  bool next_text(std::string_view& line);
  /// How many lines next() has given.
  [[nodiscard]] std::size_t lines() const noexcept { return lines_; }
  /// Whether the file ended in the middle of a line or frame; known once next() gave false.
  [[nodiscard]] bool cut() const noexcept { return cut_; }
  /// "file: line N" of the line last given.
  [[nodiscard]] std::string where() const;

 private:
  struct Decompressor;

  /// Appends to text_; false at the end of the file.
  bool read_more();

  std::filesystem::path file_;
  std::ifstream in_;
  std::unique_ptr<Decompressor> decompressor_;
  std::string text_;
  std::size_t at_ = 0, lines_ = 0;
  bool cut_ = false;
};

/// The whole lines of a log.
struct LogLines {
  std::vector<Json> lines;
  bool cut = false;  ///< see LogReader::cut
};

/// All at once. @throws Error as LogReader does
[[nodiscard]] LogLines read_log(const std::filesystem::path& file);

/// What check_log found.
struct LogSummary {
  std::size_t ticks = 0, events = 0;
  bool cut = false, has_result = false;
};

/// Reads a log and checks it: a header first, then ticks in order and events, at most one result and nothing behind it,
/// each line by its schema. A log without result, or with a cut end, is one of an unfinished run, and fine.
/// @throws Error io, parse or invalid, naming the line
LogSummary check_log(const std::filesystem::path& file);

/// Checks one line by the schema of its type. @throws Error invalid, opened by `where`
void check_line(const Json& line, const std::string& where);

}  // namespace hamelin::log

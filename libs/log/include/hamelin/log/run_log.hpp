#pragma once
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/io/json.hpp"

namespace hamelin::log {

/// Receives the lines of one run's log (schema hamelin.run/1): header, ticks and events, last a
/// result.
class LineSink {
 public:
  virtual ~LineSink() = default;
  /// Passes on {"type": type, ...fields}, with "schema" added to a header. Non-finite numbers
  /// become null, and an event after the line names them.
  void write(const char* type, const Json& fields);
  /// Whether no further line is needed, so that the run may stop.
  [[nodiscard]] bool enough() const noexcept { return enough_; }

 protected:
  virtual void take(Json line) = 0;
  bool enough_ = false;
};

/// Writes the log to a file as JSON Lines. A file named `.zst` is compressed in independent frames
/// of `lines_per_frame` lines; any other file gets its lines one by one. Both are flushed, so a
/// crash loses at most the frame or line in progress. The file is created with the first line, so a
/// run that is refused before it begins leaves no file.
class RunLog final : public LineSink {
 public:
  static constexpr std::size_t lines_per_frame = 256;

  /// @throws Error io if the file cannot be written; tried at once, without changing an existing
  /// file
  explicit RunLog(const std::filesystem::path& file);
  /// Writes lines that are still buffered. An error here is ignored; see flush().
  ~RunLog() override;
  RunLog(const RunLog&) = delete;
  RunLog& operator=(const RunLog&) = delete;

  /// Writes lines that are still buffered, as header and result do, too. @throws Error io if
  /// writing fails
  void flush();
  [[nodiscard]] const std::filesystem::path& file() const noexcept { return file_; }
  [[nodiscard]] bool compressed() const noexcept { return compressor_ != nullptr; }

 private:
  struct Compressor;

  /// @throws Error io if writing fails
  void take(Json line) override;
  void append(std::string_view bytes);

  std::filesystem::path file_;
  int fd_ = -1;
  std::unique_ptr<Compressor> compressor_;
};

/// Estimated size [bytes] of a log of `ticks` tick lines for `dof` joints, correct to a factor of
/// about two.
[[nodiscard]] double estimated_bytes(int dof, double ticks, bool compressed) noexcept;

/// Checks that a file can be written, before long work begins. A file that does not exist is
/// created and removed again; an existing one is opened and not changed.
/// @throws Error io, naming the file and the system's reason
void check_writable(const std::filesystem::path& file);

/// Replaces every non-finite number by null.
/// @return one text per replaced number, e.g. "/q/0 is nan"
std::vector<std::string> null_non_finite(Json& document);

}  // namespace hamelin::log

#pragma once
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/io/json.hpp"

namespace hamelin::log {

/// Takes the lines of one run's record (schema hamelin.run/1): header, ticks, events, last a result.
class LineSink {
 public:
  virtual ~LineSink() = default;
  /// Hands on {"type": type, ...fields}; a header is given its "schema". Non-finite numbers become null and are told in
  /// an event after the line.
  void write(const char* type, const Json& fields);
  /// Whether no further line is wanted: a run may as well stop.
  [[nodiscard]] bool enough() const noexcept { return enough_; }

 protected:
  virtual void take(Json line) = 0;
  bool enough_ = false;
};

/// Writes the record to a file, JSON Lines. A file named `.zst` is compressed, in frames of `lines_per_frame` lines
/// that stand alone; any other gets its lines one by one. Either is flushed, so a crash loses at most the frame or the
/// line that is being gathered. The file is made with the first line: a run that is refused before it begins leaves
/// nothing behind.
class RunLog final : public LineSink {
 public:
  static constexpr std::size_t lines_per_frame = 256;

  /// @throws Error io if the file cannot be written; tried at once, without touching what stands there
  explicit RunLog(const std::filesystem::path& file);
  /// Writes what is still held. An error here is lost; see flush().
  ~RunLog() override;
  RunLog(const RunLog&) = delete;
  RunLog& operator=(const RunLog&) = delete;

  /// Writes what is still held; header and result do it too. @throws Error io if the disk refuses
  void flush();
  [[nodiscard]] const std::filesystem::path& file() const noexcept { return file_; }
  [[nodiscard]] bool compressed() const noexcept { return compressor_ != nullptr; }

 private:
  struct Compressor;

  /// @throws Error io if the disk refuses
  void take(Json line) override;
  void append(std::string_view bytes);

  std::filesystem::path file_;
  int fd_ = -1;
  std::unique_ptr<Compressor> compressor_;
};

/// Bytes that a log will need, to a factor of two or so: what a robot of `dof` joints makes of `ticks` tick lines.
[[nodiscard]] double estimated_bytes(int dof, double ticks, bool compressed) noexcept;

/// Checks that a file can be written, before long work begins. An absent file is made and removed again, an existing
/// one opened and left as it is.
/// @throws Error io, naming the file and the system's reason
void check_writable(const std::filesystem::path& file);

/// Replaces every non-finite number by null.
/// @return what was replaced, e.g. "/q/0 is nan"
std::vector<std::string> null_non_finite(Json& document);

}  // namespace hamelin::log

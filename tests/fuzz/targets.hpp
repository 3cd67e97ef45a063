#pragma once
#include <cstddef>
#include <string>
#include <string_view>

#include "hamelin/core/error.hpp"

/// One function a reader. It takes any bytes at all and aborts, with a line on stderr, unless the reader keeps its
/// contract: a value whose invariants hold, or a hamelin::Error of one line that opens with the file's name. Any other
/// exception goes through, which counts as a crash.
namespace hamelin::fuzz {

void maps(std::string_view bytes);
void scene(std::string_view bytes);
void robot(std::string_view bytes);
void spheres(std::string_view bytes);
void urdf(std::string_view bytes);
void srdf(std::string_view bytes);
void log(std::string_view bytes);
void primitives(std::string_view bytes);

/// Aborts unless `kept`. `what` says what was promised.
void promise(bool kept, const std::string& what);

/// That an error's text is one line of printable UTF-8 and opens with the file's name.
void promise_message(const Error& error, std::string_view file);

/// Runs `read`.
/// @return whether it accepted its input; else it threw an Error, whose text is checked
template <typename Read>
bool accepts(std::string_view file, const Read& read) {
  try {
    read();
    return true;
  } catch (const Error& error) {
    promise_message(error, file);
    return false;
  }
}

/// Bytes as a file that has a path and lives in memory, for readers that take a path.
class MemoryFile {
 public:
  explicit MemoryFile(std::string_view bytes);
  ~MemoryFile();
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  [[nodiscard]] const std::string& path() const noexcept { return path_; }

 private:
  int fd_;
  std::string path_;
};

}  // namespace hamelin::fuzz

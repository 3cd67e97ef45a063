#pragma once
#include <cstddef>
#include <string>
#include <string_view>

#include "hamelin/core/error.hpp"

/// One function per reader. It takes arbitrary bytes and aborts with a line on stderr if the reader
/// violates its contract: the reader returns a value whose invariants hold, or throws a
/// hamelin::Error whose text is one line that begins with the file's name. Any other exception is a
/// crash.
namespace hamelin::fuzz {

void maps(std::string_view bytes);
void scene(std::string_view bytes);
void robot(std::string_view bytes);
void spheres(std::string_view bytes);
void urdf(std::string_view bytes);
void srdf(std::string_view bytes);
void log(std::string_view bytes);
void primitives(std::string_view bytes);
void waypoints(std::string_view bytes);
void target_line(std::string_view bytes);
void c_interface(std::string_view bytes);

/// c_interface(). @return the number of calls that the bytes stand for
long count_c_calls(std::string_view bytes);

/// Aborts unless `holds`, and prints the condition.
void require(bool holds, const std::string& condition);

/// Aborts unless an error's text is one line of printable UTF-8 and begins with the file's name.
void require_message(const Error& error, std::string_view file);

/// Runs `read`.
/// @return whether it accepted its input. If not, it threw an Error, whose text is checked
template <typename Read>
bool accepts(std::string_view file, const Read& read) {
  try {
    read();
    return true;
  } catch (const Error& error) {
    require_message(error, file);
    return false;
  }
}

/// A file in memory that has a path, for readers that take a path.
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

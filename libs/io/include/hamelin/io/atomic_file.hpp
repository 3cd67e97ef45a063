#pragma once
#include <filesystem>
#include <string>
#include <string_view>

namespace hamelin {

/// A file that is written piece by piece under a temporary name in the same directory. Only
/// commit() gives it its own name, so that readers see either the old content or all of the new.
class AtomicFile {
 public:
  /// @throws Error io with the file's name, as all functions of this class
  explicit AtomicFile(std::filesystem::path file);
  /// Removes what was written if it was not committed.
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void append(std::string_view bytes);
  /// Appends nothing else; the file then has its name, and survives a loss of power.
  void commit();

 private:
  void flush();
  [[noreturn]] void fail(const char* problem) const;

  std::filesystem::path file_;
  std::string temporary_;
  std::string buffer_;
  int descriptor_;
};

}  // namespace hamelin

#pragma once
#include <filesystem>
#include <string>

namespace hamelin::sweep {

/// Keeps other processes from planning or running a sweep in a directory, by an exclusive lock on
/// its file of records. The file is created if it does not exist.
class DirectoryLock {
 public:
  /// @throws Error io if the file cannot be opened, or if another process holds the lock
  explicit DirectoryLock(const std::filesystem::path& directory);
  ~DirectoryLock();
  DirectoryLock(const DirectoryLock&) = delete;
  DirectoryLock& operator=(const DirectoryLock&) = delete;

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// Open for writing.
  [[nodiscard]] int descriptor() const noexcept { return descriptor_; }
  /// Throws an Error with the file's name and the message of `errno`.
  [[noreturn]] void fail() const;

 private:
  std::string name_;
  int descriptor_;
};

}  // namespace hamelin::sweep

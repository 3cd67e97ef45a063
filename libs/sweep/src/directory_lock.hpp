#pragma once
#include <filesystem>
#include <string>

namespace hamelin::sweep {

/// Keeps other processes from planning or running in a sweep's directory: an exclusive lock on its file of records,
/// which is made if there is none.
class DirectoryLock {
 public:
  /// @throws Error io if the file cannot be opened, or another process has the lock
  explicit DirectoryLock(const std::filesystem::path& directory);
  ~DirectoryLock();
  DirectoryLock(const DirectoryLock&) = delete;
  DirectoryLock& operator=(const DirectoryLock&) = delete;

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// Open for writing.
  [[nodiscard]] int descriptor() const noexcept { return descriptor_; }
  /// Throws what `errno` says of the file.
  [[noreturn]] void fail() const;

 private:
  std::string name_;
  int descriptor_;
};

}  // namespace hamelin::sweep

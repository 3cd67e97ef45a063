#pragma once
#include <filesystem>
#include <string>

namespace hamelin::sweep {

/// A file that is open for writing, with a lock that other processes respect. The file is created
/// if it does not exist.
class FileLock {
 public:
  enum class Mode { exclusive, shared };
  /// @param scope ends the message: "expected one at a time per {scope}"
  /// @throws Error io if the file cannot be opened, or if another process holds a lock that
  ///         excludes this one
  FileLock(const std::filesystem::path& file, Mode mode, const std::string& scope);
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// Open for writing.
  [[nodiscard]] int descriptor() const noexcept { return descriptor_; }
  /// Throws an Error with the file's name and the message of `errno`.
  [[noreturn]] void fail() const;

 private:
  std::string name_;
  int descriptor_;
};

/// The lock on a directory's file of records. Planning, and running without shards, hold it
/// exclusively; shards that run at the same time share it.
class DirectoryLock : public FileLock {
 public:
  explicit DirectoryLock(const std::filesystem::path& directory, Mode mode = Mode::exclusive);
};

}  // namespace hamelin::sweep

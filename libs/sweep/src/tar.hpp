#pragma once
#include <archive.h>
#include <archive_entry.h>

#include <exception>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "hamelin/io/atomic_file.hpp"

namespace hamelin::sweep {

/// The file that describes an archive, and is its first entry.
inline constexpr const char* manifest_name = "hamelin-archive.json";

/// Writes a tar archive compressed by zstd, as an AtomicFile. The same files give the same bytes:
/// entries have no owner and no time. @throws Error io, as all functions of this class
class TarWriter {
 public:
  explicit TarWriter(const std::filesystem::path& file);
  void add(const std::string& name, std::string_view bytes);
  /// Ends the archive; the file then has its name.
  void commit();

 private:
  static la_ssize_t write_block(archive*, void* writer, const void* bytes, std::size_t size);
  void check(int result);
  std::string name_;
  AtomicFile out_;
  std::exception_ptr failure_;  ///< of writing, which cannot pass through the library in C
  std::unique_ptr<archive, int (*)(archive*)> archive_;
};

/// Reads an archive file by file. @throws Error invalid, as all functions of this class, if it is
/// damaged or has entries other than files
class TarReader {
 public:
  explicit TarReader(const std::filesystem::path& file);
  /// Goes to the next file; false at the end.
  [[nodiscard]] bool next();
  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// The bytes of the file, of which there must be at most `most`.
  [[nodiscard]] std::string read_all(std::size_t most);
  void extract(const std::filesystem::path& to);

 private:
  std::size_t read(char* to, std::size_t most);
  [[noreturn]] void refuse(const std::string& problem) const;
  [[noreturn]] void fail() const;

  std::filesystem::path file_;
  std::unique_ptr<archive, int (*)(archive*)> archive_;
  archive_entry* entry_ = nullptr;
  std::string name_;
};

}  // namespace hamelin::sweep

#include "tar.hpp"

#include <fmt/format.h>

#include <fstream>
#include <utility>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/core/shared_library.hpp"

namespace hamelin::sweep {

namespace fs = std::filesystem;

namespace {

// The functions of libarchive that are used; it is loaded for the first archive.
struct Libarchive {
  SharedLibrary library{HAMELIN_LIBARCHIVE_FILE, "an archive of a sweep"};
  HAMELIN_LOADED(library, archive_entry_filetype);
  HAMELIN_LOADED(library, archive_entry_free);
  HAMELIN_LOADED(library, archive_entry_hardlink);
  HAMELIN_LOADED(library, archive_entry_new);
  HAMELIN_LOADED(library, archive_entry_pathname);
  HAMELIN_LOADED(library, archive_entry_set_filetype);
  HAMELIN_LOADED(library, archive_entry_set_mtime);
  HAMELIN_LOADED(library, archive_entry_set_pathname);
  HAMELIN_LOADED(library, archive_entry_set_perm);
  HAMELIN_LOADED(library, archive_entry_set_size);
  HAMELIN_LOADED(library, archive_error_string);
  HAMELIN_LOADED(library, archive_read_data);
  HAMELIN_LOADED(library, archive_read_free);
  HAMELIN_LOADED(library, archive_read_new);
  HAMELIN_LOADED(library, archive_read_next_header);
  HAMELIN_LOADED(library, archive_read_open_filename);
  HAMELIN_LOADED(library, archive_read_support_filter_zstd);
  HAMELIN_LOADED(library, archive_read_support_format_tar);
  HAMELIN_LOADED(library, archive_write_add_filter_zstd);
  HAMELIN_LOADED(library, archive_write_close);
  HAMELIN_LOADED(library, archive_write_data);
  HAMELIN_LOADED(library, archive_write_free);
  HAMELIN_LOADED(library, archive_write_header);
  HAMELIN_LOADED(library, archive_write_new);
  HAMELIN_LOADED(library, archive_write_open);
  HAMELIN_LOADED(library, archive_write_set_bytes_in_last_block);
  HAMELIN_LOADED(library, archive_write_set_format_pax_restricted);
};

const Libarchive& libarchive() {
  static const Libarchive functions;
  return functions;
}

}  // namespace

constexpr std::size_t block_size = std::size_t{1} << 16;

la_ssize_t TarWriter::write_block(archive*, void* writer, const void* bytes, std::size_t size) {
  auto& to = *static_cast<TarWriter*>(writer);
  try {
    to.out_.append({static_cast<const char*>(bytes), size});
    return static_cast<la_ssize_t>(size);
  } catch (...) {
    to.failure_ = std::current_exception();
    return -1;
  }
}

TarWriter::TarWriter(const fs::path& file)
    : name_(file.string()),
      out_(file),
      archive_(libarchive().archive_write_new(), libarchive().archive_write_free) {
  check(libarchive().archive_write_set_format_pax_restricted(archive_.get()));
  check(libarchive().archive_write_add_filter_zstd(archive_.get()));
  check(libarchive().archive_write_set_bytes_in_last_block(archive_.get(),
                                                           1));  // no padding after the end
  check(libarchive().archive_write_open(archive_.get(), this, nullptr, &TarWriter::write_block,
                                        nullptr));
}

void TarWriter::add(const std::string& name, std::string_view bytes) {
  const std::unique_ptr<archive_entry, decltype(&archive_entry_free)> entry(
      libarchive().archive_entry_new(), libarchive().archive_entry_free);
  libarchive().archive_entry_set_pathname(entry.get(), name.c_str());
  libarchive().archive_entry_set_size(entry.get(), static_cast<la_int64_t>(bytes.size()));
  libarchive().archive_entry_set_filetype(entry.get(), AE_IFREG);
  libarchive().archive_entry_set_perm(entry.get(), 0644);
  libarchive().archive_entry_set_mtime(entry.get(), 0, 0);
  check(libarchive().archive_write_header(archive_.get(), entry.get()));
  if (libarchive().archive_write_data(archive_.get(), bytes.data(), bytes.size()) !=
      static_cast<la_ssize_t>(bytes.size()))
    check(ARCHIVE_FATAL);
}

void TarWriter::commit() {
  check(libarchive().archive_write_close(archive_.get()));
  out_.commit();
}

void TarWriter::check(int result) {
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  if (result != ARCHIVE_OK)
    throw Error(ErrorCode::io, fmt::format("{}: cannot be written: {}", name_,
                                           libarchive().archive_error_string(archive_.get())));
}

TarReader::TarReader(const fs::path& file)
    : file_(file), archive_(libarchive().archive_read_new(), libarchive().archive_read_free) {
  std::error_code ec;
  if (!fs::is_regular_file(file, ec))
    throw Error(ErrorCode::io,
                fmt::format("{}: is not a file, expected an archive of `hamelin sweep pack`",
                            file.string()));
  libarchive().archive_read_support_format_tar(archive_.get());
  libarchive().archive_read_support_filter_zstd(archive_.get());
  if (libarchive().archive_read_open_filename(archive_.get(), file.c_str(), block_size) !=
      ARCHIVE_OK)
    fail();
}

bool TarReader::next() {
  const int result = libarchive().archive_read_next_header(archive_.get(), &entry_);
  if (result == ARCHIVE_EOF) return false;
  if (result != ARCHIVE_OK) fail();
  const char* name = libarchive().archive_entry_pathname(entry_);
  name_ = name == nullptr ? "" : name;
  if (libarchive().archive_entry_filetype(entry_) != AE_IFREG ||
      libarchive().archive_entry_hardlink(entry_) != nullptr)
    refuse(fmt::format("'{}' is not a file, expected files only", name_));
  return true;
}

std::string TarReader::read_all(std::size_t most) {
  std::string bytes;
  std::vector<char> block(block_size);
  while (const std::size_t count = read(block.data(), block.size())) {
    bytes.append(block.data(), count);
    if (bytes.size() > most)
      refuse(fmt::format("'{}' has more than {} bytes, expected fewer", name_, most));
  }
  return bytes;
}

void TarReader::extract(const fs::path& to) {
  std::ofstream out(to, std::ios::binary);
  std::vector<char> block(block_size);
  while (const std::size_t count = read(block.data(), block.size()))
    out.write(block.data(), static_cast<std::streamsize>(count));
  out.close();
  if (!out) throw Error(ErrorCode::io, fmt::format("{}: cannot be written", to.string()));
}

std::size_t TarReader::read(char* to, std::size_t most) {
  const auto count = libarchive().archive_read_data(archive_.get(), to, most);
  if (count < 0) fail();
  return static_cast<std::size_t>(count);
}

void TarReader::refuse(const std::string& problem) const {
  throw Error(ErrorCode::invalid, fmt::format("{}: {}", file_.string(), problem));
}

void TarReader::fail() const {
  const char* text = libarchive().archive_error_string(archive_.get());
  refuse(fmt::format("is not an archive of `hamelin sweep pack`, or is damaged: {}",
                     text == nullptr ? "unknown error" : text));
}

}  // namespace hamelin::sweep

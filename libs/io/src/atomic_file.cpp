#include "hamelin/io/atomic_file.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"

namespace hamelin {

namespace {

constexpr std::size_t buffer_max = std::size_t{1} << 18;

}  // namespace

AtomicFile::AtomicFile(std::filesystem::path file)
    : file_(std::move(file)),
      temporary_(file_.string() + ".XXXXXX"),
      descriptor_(::mkstemp(temporary_.data())) {
  if (descriptor_ < 0) fail("cannot be written");
}

AtomicFile::~AtomicFile() {
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  ::unlink(temporary_.c_str());
}

void AtomicFile::append(std::string_view bytes) {
  buffer_ += bytes;
  if (buffer_.size() >= buffer_max) flush();
}

void AtomicFile::commit() {
  flush();
  if (::fchmod(descriptor_, 0644) != 0 || ::fsync(descriptor_) != 0) fail("cannot be written");
  if (std::rename(temporary_.c_str(), file_.c_str()) != 0) fail("cannot be replaced");
  ::close(std::exchange(descriptor_, -1));
}

void AtomicFile::flush() {
  for (std::size_t done = 0; done < buffer_.size();) {
    const ::ssize_t n = ::write(descriptor_, buffer_.data() + done, buffer_.size() - done);
    if (n < 0 && errno != EINTR) fail("cannot be written");
    if (n > 0) done += static_cast<std::size_t>(n);
  }
  buffer_.clear();
}

void AtomicFile::fail(const char* problem) const {
  throw Error(ErrorCode::io,
              fmt::format("{}: {}: {}", file_.string(), problem, std::strerror(errno)));
}

void write_file_atomically(const std::filesystem::path& file, std::string_view content) {
  AtomicFile out(file);
  out.append(content);
  out.commit();
}

}  // namespace hamelin

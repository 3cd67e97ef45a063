#include "hamelin/io/file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/evp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "hamelin/core/error.hpp"

namespace hamelin {

namespace {

/// A file open for reading.
class Descriptor {
 public:
  explicit Descriptor(const std::filesystem::path& file)
      : fd_(::open(file.c_str(), O_RDONLY | O_CLOEXEC)) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  [[nodiscard]] int get() const noexcept { return fd_; }

 private:
  int fd_;
};

}  // namespace

std::string read_file(const std::filesystem::path& file) {
  const auto fail = [&file](const std::string& message) {
    return Error(ErrorCode::io, fmt::format("{}: {}", file.string(), message));
  };
  const Descriptor in(file);
  if (in.get() < 0) throw fail(fmt::format("cannot be opened: {}", std::strerror(errno)));
  struct stat status {};
  if (::fstat(in.get(), &status) != 0)
    throw fail(fmt::format("cannot be read: {}", std::strerror(errno)));
  if (S_ISDIR(status.st_mode)) throw fail("is a directory, expected a file");
  // A scene may name /dev/zero as its map, and reading that never ends.
  if (S_ISCHR(status.st_mode) || S_ISBLK(status.st_mode))
    throw fail("is a device, expected a file");
  constexpr std::size_t min_growth = std::size_t{1} << 16;
  std::string bytes;
  for (std::size_t size = 0;;) {
    // One byte more than the file has, so the end of the file is found without growing the buffer.
    if (size == bytes.size())
      bytes.resize(std::max(static_cast<std::size_t>(status.st_size) + 1, size + min_growth));
    const ::ssize_t count = ::read(in.get(), bytes.data() + size, bytes.size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw fail(fmt::format("cannot be read: {}", std::strerror(errno)));
    size += static_cast<std::size_t>(count);
    if (count > 0) continue;
    bytes.resize(size);
    return bytes;
  }
}

std::filesystem::path resolve_path(const std::filesystem::path& base,
                                   const std::filesystem::path& path) {
  std::filesystem::path resolved;
  for (const auto& part : base / path) {
    if (part.empty() || part == ".") continue;
    std::error_code ec;
    const bool up = part == "..";
    // The parent of the root is the root.
    if (up && resolved.has_root_path() && !resolved.has_relative_path()) continue;
    if (up && resolved.has_filename() && resolved.filename() != ".." &&
        std::filesystem::symlink_status(resolved, ec).type() ==
            std::filesystem::file_type::directory)
      resolved = resolved.parent_path();
    else
      resolved /= part;
  }
  return resolved.empty() ? std::filesystem::path(".") : resolved;
}

void write_file_atomically(const std::filesystem::path& file, std::string_view content) {
  std::string temporary = file.string() + ".XXXXXX";
  const int fd = ::mkstemp(temporary.data());
  const auto fail = [&](const char* problem) {
    const int reason = errno;
    if (fd >= 0) {
      ::close(fd);
      ::unlink(temporary.c_str());
    }
    throw Error(ErrorCode::io,
                fmt::format("{}: {}: {}", file.string(), problem, std::strerror(reason)));
  };
  if (fd < 0) fail("cannot be written");
  for (std::size_t done = 0; done < content.size();) {
    const ::ssize_t n = ::write(fd, content.data() + done, content.size() - done);
    if (n < 0 && errno != EINTR) fail("cannot be written");
    if (n > 0) done += static_cast<std::size_t>(n);
  }
  if (::fchmod(fd, 0644) != 0 || ::fsync(fd) != 0) fail("cannot be written");
  if (std::rename(temporary.c_str(), file.c_str()) != 0) fail("cannot be replaced");
  ::close(fd);
}

std::string sha256_hex(std::string_view bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), digest.data(), &size, EVP_sha256(), nullptr) != 1)
    throw Error(ErrorCode::io, "SHA-256 is not available in this OpenSSL");
  std::string hex;
  for (unsigned int i = 0; i < size; ++i) hex += fmt::format("{:02x}", digest[i]);
  return hex;
}

}  // namespace hamelin

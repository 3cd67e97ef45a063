#include "hamelin/io/file.hpp"

#include <fmt/format.h>
#include <openssl/evp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

#include "hamelin/core/error.hpp"

namespace hamelin {

std::string read_file(const std::filesystem::path& file) {
  std::error_code ec;
  if (std::filesystem::is_directory(file, ec))
    throw Error(ErrorCode::io, fmt::format("{}: is a directory, want a file", file.string()));
  // A scene may name /dev/zero as its map, which has no end.
  if (std::filesystem::is_character_file(file, ec) || std::filesystem::is_block_file(file, ec))
    throw Error(ErrorCode::io, fmt::format("{}: is a device, want a file", file.string()));
  std::ifstream in(file, std::ios::binary);
  if (!in) throw Error(ErrorCode::io, fmt::format("{}: cannot be opened: {}", file.string(), std::strerror(errno)));
  std::ostringstream text;
  text << in.rdbuf();
  if (in.bad()) throw Error(ErrorCode::io, fmt::format("{}: cannot be read: {}", file.string(), std::strerror(errno)));
  return std::move(text).str();
}

void write_file_aside(const std::filesystem::path& file, std::string_view content) {
  std::string aside = file.string() + ".XXXXXX";
  const int fd = ::mkstemp(aside.data());
  const auto fail = [&](const char* what) {
    const int reason = errno;
    if (fd >= 0) {
      ::close(fd);
      ::unlink(aside.c_str());
    }
    throw Error(ErrorCode::io, fmt::format("{}: {}: {}", file.string(), what, std::strerror(reason)));
  };
  if (fd < 0) fail("cannot be written");
  for (std::size_t done = 0; done < content.size();) {
    const ::ssize_t n = ::write(fd, content.data() + done, content.size() - done);
    if (n < 0 && errno != EINTR) fail("cannot be written");
    if (n > 0) done += static_cast<std::size_t>(n);
  }
  if (::fchmod(fd, 0644) != 0 || ::fsync(fd) != 0) fail("cannot be written");
  if (std::rename(aside.c_str(), file.c_str()) != 0) fail("cannot be replaced");
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

#include "hamelin/io/file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/evp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <utility>
#include <vector>

#include "hamelin/core/error.hpp"

namespace hamelin {

namespace {

/// A file open for reading, no directory and no device: a scene may name /dev/zero as its map, and
/// reading that never ends.
class InputFile {
 public:
  explicit InputFile(const std::filesystem::path& file)
      : file_(file), fd_(::open(file.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (fd_ < 0) fail(fmt::format("cannot be opened: {}", std::strerror(errno)));
    if (::fstat(fd_, &status_) != 0) fail(fmt::format("cannot be read: {}", std::strerror(errno)));
    if (S_ISDIR(status_.st_mode)) fail("is a directory, expected a file");
    if (S_ISCHR(status_.st_mode) || S_ISBLK(status_.st_mode)) fail("is a device, expected a file");
  }
  ~InputFile() {
    if (fd_ >= 0) ::close(fd_);
  }
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;
  [[nodiscard]] std::size_t size() const noexcept {
    return static_cast<std::size_t>(status_.st_size);
  }
  /// @return how many bytes were read, zero at the end of the file
  std::size_t read(char* to, std::size_t most) {
    for (;;) {
      const ::ssize_t count = ::read(fd_, to, most);
      if (count >= 0) return static_cast<std::size_t>(count);
      if (errno != EINTR) fail(fmt::format("cannot be read: {}", std::strerror(errno)));
    }
  }

 private:
  [[noreturn]] void fail(const std::string& message) {
    if (fd_ >= 0) ::close(std::exchange(fd_, -1));
    throw Error(ErrorCode::io, fmt::format("{}: {}", file_.string(), message));
  }

  const std::filesystem::path& file_;
  int fd_;
  struct stat status_ {};
};

/// The SHA-256 of bytes that arrive one after the other.
class Sha256 {
 public:
  Sha256() : context_(EVP_MD_CTX_new(), &EVP_MD_CTX_free) {
    check(context_ ? EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr) : 0);
  }
  void add(const char* bytes, std::size_t count) {
    check(EVP_DigestUpdate(context_.get(), bytes, count));
  }
  [[nodiscard]] std::string hex() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned int size = 0;
    check(EVP_DigestFinal_ex(context_.get(), digest.data(), &size));
    std::string hex;
    for (unsigned int i = 0; i < size; ++i) hex += fmt::format("{:02x}", digest[i]);
    return hex;
  }

 private:
  static void check(int result) {
    if (result != 1) throw Error(ErrorCode::io, "SHA-256 is not available in this OpenSSL");
  }
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

constexpr std::size_t block_size = std::size_t{1} << 16;

}  // namespace

std::string read_file(const std::filesystem::path& file) {
  InputFile in(file);
  std::string bytes;
  for (std::size_t size = 0;;) {
    // One byte more than the file has, so the end of the file is found without growing the buffer.
    if (size == bytes.size()) bytes.resize(std::max(in.size() + 1, size + block_size));
    const std::size_t count = in.read(bytes.data() + size, bytes.size() - size);
    size += count;
    if (count > 0) continue;
    bytes.resize(size);
    return bytes;
  }
}

std::string sha256_of_file(const std::filesystem::path& file) {
  InputFile in(file);
  Sha256 hash;
  std::vector<char> block(block_size);
  while (const std::size_t count = in.read(block.data(), block.size()))
    hash.add(block.data(), count);
  return hash.hex();
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

std::string sha256_hex(std::string_view bytes) {
  Sha256 hash;
  hash.add(bytes.data(), bytes.size());
  return hash.hex();
}

}  // namespace hamelin

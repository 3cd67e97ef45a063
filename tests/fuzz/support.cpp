#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "targets.hpp"

namespace hamelin::fuzz {

namespace {

bool is_utf8(std::string_view text) {
  try {
    (void)nlohmann::json(text).dump();
    return true;
  } catch (const nlohmann::json::type_error&) {
    return false;
  }
}

}  // namespace

void require(bool holds, const std::string& condition) {
  if (holds) return;
  fmt::print(stderr, "check failed: {}\n", condition);
  std::abort();
}

void require_message(const Error& error, std::string_view file) {
  const std::string_view text = error.what();
  require(text.substr(0, file.size()) == file,
          fmt::format("an error begins with '{}': {}", file, text));
  for (const char c : text)
    require(static_cast<unsigned char>(c) >= ' ' && c != '\x7f',
            fmt::format("an error is one line: {}", text));
  require(is_utf8(text), "an error is UTF-8");
}

MemoryFile::MemoryFile(std::string_view bytes) : fd_(::memfd_create("hamelin_fuzz", MFD_CLOEXEC)) {
  require(fd_ >= 0, "a file in memory can be made");
  path_ = fmt::format("/proc/self/fd/{}", fd_);
  for (std::size_t done = 0; done < bytes.size();) {
    const ::ssize_t n = ::write(fd_, bytes.data() + done, bytes.size() - done);
    require(n > 0, "a file in memory can be written");
    done += static_cast<std::size_t>(n);
  }
}

MemoryFile::~MemoryFile() {
  ::close(fd_);
}

}  // namespace hamelin::fuzz

#include "file_lock.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "hamelin/core/error.hpp"
#include "hamelin/sweep/records.hpp"

namespace hamelin::sweep {

// Open for reading, too: on network file systems, a shared lock needs it.
FileLock::FileLock(const std::filesystem::path& file, Mode mode, const std::string& scope)
    : name_(file.string()), descriptor_(::open(name_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666)) {
  if (descriptor_ < 0) fail();
  if (::flock(descriptor_, (mode == Mode::exclusive ? LOCK_EX : LOCK_SH) | LOCK_NB) == 0) return;
  const int reason = errno;
  ::close(descriptor_);
  if (reason == EWOULDBLOCK)
    throw Error(ErrorCode::io,
                fmt::format("{}: another sweep command is using it, expected one at a time per {}",
                            name_, scope));
  errno = reason;
  fail();
}

FileLock::~FileLock() {
  ::close(descriptor_);
}

void FileLock::fail() const {
  throw Error(ErrorCode::io, fmt::format("{}: cannot be written: {}", name_, std::strerror(errno)));
}

DirectoryLock::DirectoryLock(const std::filesystem::path& directory, Mode mode)
    : FileLock(records_file(directory), mode, "directory") {}

}  // namespace hamelin::sweep

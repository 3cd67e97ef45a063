#include "directory_lock.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "hamelin/core/error.hpp"
#include "hamelin/sweep/plan.hpp"

namespace hamelin::sweep {

DirectoryLock::DirectoryLock(const std::filesystem::path& directory)
    : name_(records_file(directory).string()),
      descriptor_(::open(name_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666)) {
  if (descriptor_ < 0) fail();
  if (::flock(descriptor_, LOCK_EX | LOCK_NB) == 0) return;
  const int reason = errno;
  ::close(descriptor_);
  if (reason == EWOULDBLOCK)
    throw Error(
        ErrorCode::io,
        fmt::format("{}: another sweep command is using it, expected one at a time per directory",
                    name_));
  errno = reason;
  fail();
}

DirectoryLock::~DirectoryLock() {
  ::close(descriptor_);
}

void DirectoryLock::fail() const {
  throw Error(ErrorCode::io, fmt::format("{}: cannot be written: {}", name_, std::strerror(errno)));
}

}  // namespace hamelin::sweep

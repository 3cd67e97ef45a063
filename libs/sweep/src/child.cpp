#include "child.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "hamelin/core/error.hpp"
#include "hamelin/core/parent_death.hpp"

namespace hamelin::sweep {

namespace {

// Exit codes of a child that cannot be set up, and of one that ends by an exception.
constexpr int not_set_up = 126, by_exception = 3;

// Gives a child empty input, its outputs and a group of its own. Safe between fork and exec.
bool set_up(pid_t parent, int out, int err) noexcept {
  ::setpgid(0, 0);
  end_with_parent(parent);
  const int nothing = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  return ::dup2(nothing, STDIN_FILENO) >= 0 && ::dup2(out, STDOUT_FILENO) >= 0 &&
         ::dup2(err, STDERR_FILENO) >= 0;
}

// Reads the number that a child sends, 0 if it sends none. Closed by exec, the pipe ends.
int receive_errno(int from) {
  int number = 0;
  while (::read(from, &number, sizeof number) < 0 && errno == EINTR) {
  }
  return number;
}

// Starts a program. posix_spawn cannot set the signal for the parent's death.
// @return its process id
pid_t spawn(const std::vector<std::string>& command, int out, int err) {
  std::vector<char*> argv;
  argv.reserve(command.size() + 1);
  for (const auto& argument : command) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  std::array<int, 2> failure{};
  if (::pipe2(failure.data(), O_CLOEXEC) != 0)
    throw Error(ErrorCode::io, fmt::format("cannot create a pipe: {}", std::strerror(errno)));
  const pid_t parent = ::getpid(), pid = ::fork();
  if (pid == 0) {
    if (set_up(parent, out, err)) ::execv(argv[0], argv.data());
    const int reason = errno;
    ::_exit(::write(failure[1], &reason, sizeof reason) > 0 ? not_set_up : by_exception);
  }
  const int not_forked = errno;
  ::close(failure[1]);
  const int failed = pid < 0 ? not_forked : receive_errno(failure[0]);
  ::close(failure[0]);
  if (failed == 0) return pid;
  if (pid > 0) (void)::waitpid(pid, nullptr, 0);
  throw Error(ErrorCode::io,
              fmt::format("{}: cannot be started: {}", command.front(), std::strerror(failed)));
}

// The life of a forked child.
[[noreturn]] void live(const std::vector<std::string>& command, const Main& main, pid_t parent,
                       int out, int err) noexcept {
  if (!set_up(parent, out, err)) ::_exit(not_set_up);
  // Above all the locks of the sweep, which must not outlive the parent.
  ::close_range(STDERR_FILENO + 1, ~0U, 0);
  int status = by_exception;
  try {
    status = main(command);
  } catch (...) {  // NOLINT(bugprone-empty-catch): the exit code says it
  }
  if (std::fflush(stdout) != 0) status = by_exception;
  ::_exit(status);  // without the destructors of the parent's objects
}

// Calls `main` in a fork of this process. @return the child's process id
pid_t fork_main(const std::vector<std::string>& command, const Main& main, int out, int err) {
  std::fflush(nullptr);  // or the child would print what is buffered once more
  const pid_t parent = ::getpid(), pid = ::fork();
  if (pid < 0)
    throw Error(ErrorCode::io, fmt::format("cannot start a run: {}", std::strerror(errno)));
  if (pid == 0) live(command, main, parent, out, err);
  ::setpgid(pid, pid);  // here too, because either process may be first
  return pid;
}

}  // namespace

Pipe::Pipe() {
  // reading must not block: a process that the run left behind may keep the other end open
  if (::pipe2(ends_.data(), O_CLOEXEC) != 0 || ::fcntl(ends_[0], F_SETFL, O_NONBLOCK) != 0)
    throw Error(ErrorCode::io, fmt::format("cannot create a pipe: {}", std::strerror(errno)));
}

Pipe::~Pipe() {
  close(0);
  close(1);
}

Pipe::Pipe(Pipe&& other) noexcept : ends_(other.ends_), text_(std::move(other.text_)) {
  other.ends_ = {-1, -1};
}

void Pipe::read() {
  std::array<char, 16384> buffer{};
  for (int i = 0; i < 8 && open(); ++i) {
    const auto count = ::read(ends_[0], buffer.data(), buffer.size());
    if (count > 0)
      text_.append(buffer.data(), static_cast<std::size_t>(count));
    else if (count == 0 || (errno != EINTR && errno != EAGAIN))
      close(0);
    else if (errno == EAGAIN)
      return;
  }
}

void Pipe::close(std::size_t end) noexcept {
  if (ends_[end] >= 0) ::close(ends_[end]);
  ends_[end] = -1;
}

Child::Child(const PlannedRun& of, const std::vector<std::string>& command, const Main& main)
    : run(&of) {
  pid = main ? fork_main(command, main, out.writer(), err.writer())
             : spawn(command, out.writer(), err.writer());
  out.close_writer();
  err.close_writer();
}

void Child::signal_group(int signal) const noexcept {
  ::kill(-pid, signal);
}

bool Child::ended(bool wait) const noexcept {
  siginfo_t about{};
  const int options = WEXITED | WNOWAIT | (wait ? 0 : WNOHANG);
  int failed = 0;
  while ((failed = ::waitid(P_PID, static_cast<id_t>(pid), &about, options)) != 0 &&
         errno == EINTR) {
  }
  return failed != 0 || about.si_pid == pid;
}

int Child::reap() const noexcept {
  signal_group(SIGKILL);
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

}  // namespace hamelin::sweep

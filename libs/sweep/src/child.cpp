#include "child.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "hamelin/core/error.hpp"

namespace hamelin::sweep {

namespace {

// Exit codes of a child that cannot be set up, and of one that ends by an exception.
constexpr int not_set_up = 126, by_exception = 3;

// Starts a program. @return its process id
pid_t spawn(const std::vector<std::string>& command, int out, int err) {
  std::vector<char*> argv;
  argv.reserve(command.size() + 1);
  for (const auto& argument : command) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, out, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, err, STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);  // the default group 0: a new group
  pid_t pid = -1;
  const int failed = ::posix_spawn(&pid, argv[0], &actions, &attributes, argv.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0)
    throw Error(ErrorCode::io,
                fmt::format("{}: cannot be started: {}", command.front(), std::strerror(failed)));
  return pid;
}

// The life of a forked child.
[[noreturn]] void live(const std::vector<std::string>& command, const Main& main, int out,
                       int err) noexcept {
  const int nothing = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  if (::dup2(nothing, STDIN_FILENO) < 0 || ::dup2(out, STDOUT_FILENO) < 0 ||
      ::dup2(err, STDERR_FILENO) < 0)
    ::_exit(not_set_up);
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

// Forks this process. @return the child's process id
pid_t fork_process(const std::vector<std::string>& command, const Main& main, int out, int err) {
  std::fflush(nullptr);  // or the child would print what is buffered once more
  const pid_t pid = ::fork();
  if (pid < 0)
    throw Error(ErrorCode::io, fmt::format("cannot start a run: {}", std::strerror(errno)));
  if (pid == 0) {
    ::setpgid(0, 0);
    live(command, main, out, err);
  }
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
  pid = main ? fork_process(command, main, out.writer(), err.writer())
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

#include "child_process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <exception>

#include "hamelin/core/error.hpp"
#include "hamelin/core/parent_death.hpp"

namespace hamelin::app {

namespace {

std::string line_of(const std::function<std::string()>& action) {
  try {
    return action();
  } catch (const std::exception& e) {
    return e.what();
  }
}

// Writes all bytes; the parent reads until the end.
void send(int fd, const std::string& text) {
  std::size_t sent = 0;
  while (sent < text.size()) {
    const ssize_t count = ::write(fd, text.data() + sent, text.size() - sent);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return;
    sent += static_cast<std::size_t>(count);
  }
}

// Reads until the end of the stream. @return whether it came in time
bool receive(int fd, double timeout_s, std::string& text) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout_s);
  for (;;) {
    const std::chrono::duration<double, std::milli> left = end - std::chrono::steady_clock::now();
    if (left.count() <= 0.0) return false;
    pollfd waiting{fd, POLLIN, 0};
    if (::poll(&waiting, 1, static_cast<int>(left.count()) + 1) <= 0) continue;
    std::array<char, 4096> part{};
    const ssize_t count = ::read(fd, part.data(), part.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return true;
    text.append(part.data(), static_cast<std::size_t>(count));
  }
}

}  // namespace

std::string run_in_child(const std::function<std::string()>& action, double timeout_s) {
  std::array<int, 2> pipe_ends{};
  if (::pipe2(pipe_ends.data(), O_CLOEXEC) != 0)
    throw Error(ErrorCode::io, fmt::format("pipe: {}", std::strerror(errno)));
  const pid_t parent = ::getpid(), child = ::fork();
  if (child < 0) throw Error(ErrorCode::io, fmt::format("fork: {}", std::strerror(errno)));
  if (child == 0) {
    end_with_parent(parent);
    ::close(pipe_ends[0]);
    ::dup2(STDERR_FILENO, STDOUT_FILENO);
    // The mark says that the action came to its end.
    send(pipe_ends[1], line_of(action) + '\0');
    ::_exit(0);
  }
  ::close(pipe_ends[1]);
  std::string text;
  const bool in_time = receive(pipe_ends[0], timeout_s, text);
  ::close(pipe_ends[0]);
  if (!in_time) ::kill(child, SIGKILL);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (!text.empty() && text.back() == '\0') return text.substr(0, text.size() - 1);
  if (!in_time) return fmt::format("did not end within {} s", timeout_s);
  if (WIFSIGNALED(status))
    return fmt::format("ended the program by signal {} ({})", WTERMSIG(status),
                       strsignal(WTERMSIG(status)));
  return fmt::format("ended the program with exit code {}", WEXITSTATUS(status));
}

}  // namespace hamelin::app

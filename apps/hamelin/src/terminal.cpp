#include "terminal.hpp"

#include <fmt/format.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <memory>

namespace hamelin::app {

namespace {

std::atomic<bool> stop_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may touch it");

void on_signal(int) {
  stop_requested.store(true);
}

std::string one_line(std::string_view text) {
  std::string line(text);
  std::replace(line.begin(), line.end(), '\n', ' ');
  return line;
}

// Messages go to stderr, one line each, with the program's name in front.
spdlog::logger& messages() {
  static const auto logger = [] {
    auto made = std::make_shared<spdlog::logger>("hamelin", std::make_shared<spdlog::sinks::stderr_sink_st>());
    made->set_pattern("%n: %v");
    return made;
  }();
  return *logger;
}

bool wants_colour() {
  const char* no_colour = std::getenv("NO_COLOR");
  const char* term = std::getenv("TERM");
  return ::isatty(STDOUT_FILENO) != 0 && (no_colour == nullptr || *no_colour == '\0') &&
         (term == nullptr || std::string_view(term) != "dumb");
}

// Only for how often progress is shown; no result depends on it.
double now_s() {
  std::timespec t{};
  ::clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace

void error_line(std::string_view text) {
  messages().error("{}", one_line(text));
}

void note(std::string_view text) {
  messages().info("note: {}", one_line(text));
}

std::string coloured(std::string_view text, Colour colour) {
  static const bool wanted = wants_colour();
  if (!wanted || colour == Colour::none) return std::string(text);
  const int code = colour == Colour::good ? 32 : colour == Colour::fair ? 33 : 31;
  return fmt::format("\033[{}m{}\033[0m", code, text);
}

Progress::Progress() : terminal_(::isatty(STDERR_FILENO) != 0) {}

Progress::~Progress() {
  if (shown_) fmt::print(stderr, "\r{:40}\r", "");
}

void Progress::show(double time_s, double duration_s) {
  if (!terminal_) return;
  const double now = now_s();
  if (shown_ && now - last_shown_s_ < 0.1) return;
  fmt::print(stderr, "\r{:.1f} of {:.1f} s simulated ", time_s, duration_s);
  std::fflush(stderr);
  shown_ = true;
  last_shown_s_ = now;
}

const std::atomic<bool>& stop_on_signals() {
  struct sigaction action {};
  action.sa_handler = on_signal;
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
  return stop_requested;
}

}  // namespace hamelin::app

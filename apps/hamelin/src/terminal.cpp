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

#include "hamelin/core/text.hpp"

namespace hamelin::app {

namespace {

std::atomic<bool> stop_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may touch it");

// Whether a HangGuard lives.
std::atomic<bool> guard_lives{false};
constexpr unsigned time_to_stop_s = 2;
constexpr int exit_interrupted = 130;

void on_signal(int) {
  stop_requested.store(true);
  if (guard_lives.load()) ::alarm(time_to_stop_s);
}

void on_alarm(int) {
  if (!guard_lives.load()) return;
  constexpr std::string_view line =
      "hamelin: interrupted: the run did not stop within 2 s and was ended; its log, if any, is "
      "unfinished\n";
  (void)!::write(STDERR_FILENO, line.data(), line.size());
  ::_exit(exit_interrupted);
}

// One line per message, even if its text has line breaks: "hamelin: note: text".
class MessageFormatter final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& out) override {
    const char* level = message.level == spdlog::level::warn   ? "warning: "
                        : message.level == spdlog::level::info ? "note: "
                                                               : "";
    fmt::format_to(std::back_inserter(out), "hamelin: {}{}\n", level,
                   one_line({message.payload.data(), message.payload.size()}));
  }
  std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<MessageFormatter>();
  }
};

spdlog::logger& messages() {
  return *diagnostics();
}

bool dumb_terminal() {
  const char* term = std::getenv("TERM");
  return term != nullptr && std::string_view(term) == "dumb";
}

bool& no_colour() {
  static bool disabled = [] {
    const char* variable = std::getenv("NO_COLOR");
    return ::isatty(STDOUT_FILENO) == 0 || dumb_terminal() ||
           (variable != nullptr && *variable != '\0');
  }();
  return disabled;
}

// Wall clock, for progress and phases only; no result depends on it.
double now_s() {
  std::timespec t{};
  ::clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace

std::shared_ptr<spdlog::logger> diagnostics() {
  static const auto logger = [] {
    auto created = std::make_shared<spdlog::logger>(
        "hamelin", std::make_shared<spdlog::sinks::stderr_sink_st>());
    created->set_formatter(std::make_unique<MessageFormatter>());
    return created;
  }();
  return logger;
}

void error_line(std::string_view text) {
  messages().error(text);
}

void note(std::string_view text) {
  messages().info(text);
}

void detail(std::string_view text) {
  messages().debug(text);
}

void report(std::string_view text) {
  if (messages().should_log(spdlog::level::info)) fmt::print("{}", text);
}

void set_verbosity(Verbosity verbosity) {
  messages().set_level(verbosity == Verbosity::quiet     ? spdlog::level::err
                       : verbosity == Verbosity::verbose ? spdlog::level::debug
                                                         : spdlog::level::info);
}

Phase::Phase(std::string_view name) : name_(name), begin_s_(now_s()) {}

Phase::~Phase() {
  detail(fmt::format("{}: {:.3f} s", name_, now_s() - begin_s_));
}

void set_no_colour() {
  no_colour() = true;
}

std::string coloured(std::string_view text, Colour colour) {
  if (no_colour() || colour == Colour::none) return std::string(text);
  const int code = colour == Colour::good ? 32 : colour == Colour::fair ? 33 : 31;
  return fmt::format("\033[{}m{}\033[0m", code, text);
}

Progress::Progress(std::string unit)
    : unit_(std::move(unit)),
      in_place_(::isatty(STDERR_FILENO) != 0 && !dumb_terminal()),
      last_shown_s_(now_s()) {}

Progress::~Progress() {
  if (in_place_ && shown_) fmt::print(stderr, "\r{:60}\r", "");
}

void Progress::show(double done, double all) {
  if (!messages().should_log(spdlog::level::info)) return;
  const double now = now_s();
  if (now - last_shown_s_ < (in_place_ ? 0.1 : 10.0)) return;
  last_shown_s_ = now;
  shown_ = true;
  const std::string line = fmt::format("{:.4g} of {:.4g} {}", done, all, unit_);
  if (!in_place_) {
    fmt::print(stderr, "hamelin: {}\n", line);
    return;
  }
  fmt::print(stderr, "\r{} ", line);
  std::fflush(stderr);
}

const std::atomic<bool>& stop_on_signals() {
  struct sigaction action {};
  action.sa_handler = on_signal;
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
  return stop_requested;
}

HangGuard::HangGuard() noexcept {
  struct sigaction action {};
  action.sa_handler = on_alarm;
  ::sigaction(SIGALRM, &action, nullptr);
  guard_lives.store(true);
  if (stop_requested.load()) ::alarm(time_to_stop_s);
}

HangGuard::~HangGuard() {
  guard_lives.store(false);
  ::alarm(0);
}

}  // namespace hamelin::app

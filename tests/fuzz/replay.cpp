// Passes each file of a corpus to a target or to the program. Each file has a process of its own,
// with the limits for any input: one second of processor time, and 64 MiB + 200 x file size of
// memory.
#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <iterator>
#include <map>
#include <vector>

#include "hamelin/io/file.hpp"
#include "targets.hpp"

namespace {

namespace fs = std::filesystem;
using hamelin::fuzz::require;

const std::map<std::string, void (*)(std::string_view)> targets{
    {"maps", hamelin::fuzz::maps},
    {"scene", hamelin::fuzz::scene},
    {"robot", hamelin::fuzz::robot},
    {"spheres", hamelin::fuzz::spheres},
    {"urdf", hamelin::fuzz::urdf},
    {"srdf", hamelin::fuzz::srdf},
    {"log", hamelin::fuzz::log},
    {"primitives", hamelin::fuzz::primitives},
    {"waypoints", hamelin::fuzz::waypoints},
    {"target_line", hamelin::fuzz::target_line},
    {"c_interface", hamelin::fuzz::c_interface}};

// Sanitizers slow the program down and need shadow memory.
#ifdef HAMELIN_SANITIZED
constexpr rlim_t seconds_max = 20;
constexpr bool memory_limited = false;
#else
constexpr rlim_t seconds_max = 1;
constexpr bool memory_limited = true;
#endif
constexpr double mebibyte = 1024.0 * 1024.0;
constexpr unsigned wall_clock_max_s = 120;  // a process that waits for ever uses no processor time

double memory_max(std::uintmax_t file_size) {
  return 64.0 * mebibyte + 200.0 * static_cast<double>(file_size);
}

struct ProcessEnd {
  int exit_code = -1;
  int signal = 0;
  double peak_bytes = 0.0;
  double cpu_s = 0.0;
};

ProcessEnd run_in_process(const std::function<void()>& work) {
  const pid_t child = ::fork();
  require(child >= 0, "a process can be made");
  if (child == 0) {
    const rlimit cpu{seconds_max, seconds_max}, core{0, 0};
    (void)::setrlimit(RLIMIT_CPU, &cpu);
    (void)::setrlimit(RLIMIT_CORE, &core);
    (void)::alarm(wall_clock_max_s);
    work();
    ::_exit(0);
  }
  int status = 0;
  rusage usage{};
  while (::wait4(child, &status, 0, &usage) < 0)
    require(errno == EINTR, "a process can be waited for");
  ProcessEnd ended;
  if (WIFEXITED(status)) ended.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) ended.signal = WTERMSIG(status);
  ended.peak_bytes = 1024.0 * static_cast<double>(usage.ru_maxrss);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  ended.cpu_s = seconds(usage.ru_utime) + seconds(usage.ru_stime);
  return ended;
}

// Describes how a process exceeded a limit or crashed; empty if it did not.
std::string describe_fault(const ProcessEnd& ended, std::uintmax_t file_size) {
  if (ended.signal == SIGXCPU || ended.signal == SIGKILL || ended.signal == SIGALRM)
    return fmt::format("hangs: not finished after {} s",
                       ended.signal == SIGALRM ? wall_clock_max_s : seconds_max);
  if (ended.signal != 0) return fmt::format("was ended by signal {}", ended.signal);
  if (memory_limited && ended.peak_bytes > memory_max(file_size))
    return fmt::format("uses {:.0f} MiB of memory, expected at most {:.0f}",
                       ended.peak_bytes / mebibyte, memory_max(file_size) / mebibyte);
  return {};
}

std::string replay_target(void (*target)(std::string_view), const fs::path& file,
                          ProcessEnd& ended) {
  const std::string bytes = hamelin::read_file(file);
  ended = run_in_process([&] { target(bytes); });
  const std::string fault = describe_fault(ended, bytes.size());
  if (!fault.empty()) return fault;
  return ended.exit_code == 0 ? "" : fmt::format("exits with code {}", ended.exit_code);
}

// Runs `program validate FILE` in an empty folder. It must accept the file, or print one line and
// exit with code 2. In both cases it must leave no file behind.
std::string replay_program(const fs::path& program, const std::string& extension,
                           const fs::path& file, ProcessEnd& ended) {
  std::string folder = fs::temp_directory_path() / "hamelin_fuzz.XXXXXX";
  require(::mkdtemp(folder.data()) != nullptr, "a folder can be made");
  const fs::path input = fs::path(folder) / ("input" + extension), messages = folder + ".stderr";
  fs::copy_file(file, input);
  const auto size = fs::file_size(file);
  ended = run_in_process([&] {
    const int out = ::open("/dev/null", O_WRONLY),
              error = ::open(messages.c_str(), O_WRONLY | O_CREAT, 0600);
    ::dup2(out, STDOUT_FILENO);
    ::dup2(error, STDERR_FILENO);
    if (::chdir(folder.c_str()) != 0) ::_exit(126);
    ::execl(program.c_str(), "hamelin", "--quiet", "validate", input.filename().c_str(), nullptr);
    ::_exit(127);
  });
  const std::string text = hamelin::read_file(messages);
  const auto files_left = std::distance(fs::directory_iterator(folder), fs::directory_iterator{});
  fs::remove_all(folder);
  fs::remove(messages);
  std::string fault = describe_fault(ended, size);
  const auto lines = std::count(text.begin(), text.end(), '\n');
  if (fault.empty() && ended.exit_code != 0 && ended.exit_code != 2)
    fault = fmt::format("exits with code {}, expected 0 or 2", ended.exit_code);
  if (fault.empty() && ended.exit_code == 2 && lines != 1)
    fault = fmt::format("prints {} lines, expected one: {}", lines, text);
  if (fault.empty() && ended.exit_code == 2 && !text.starts_with("hamelin: "))
    fault = fmt::format("prints '{}', expected a line that begins with 'hamelin: '", text);
  if (fault.empty() && files_left != 1) fault = "leaves a file behind";
  return fault;
}

int replay(const fs::path& corpus,
           const std::function<std::string(const fs::path&, ProcessEnd&)>& replay_file) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(corpus))
    if (entry.is_regular_file()) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  int faults = 0;
  ProcessEnd longest, largest;
  for (const auto& file : files) {
    ProcessEnd ended;
    const std::string fault = replay_file(file, ended);
    if (ended.cpu_s > longest.cpu_s) longest = ended;
    if (ended.peak_bytes > largest.peak_bytes) largest = ended;
    if (fault.empty()) continue;
    fmt::print(stderr, "{}: {}\n", file.string(), fault);
    ++faults;
  }
  fmt::print("{}: {} files, {} faults; at most {:.3f} s and {:.1f} MiB\n", corpus.string(),
             files.size(), faults, longest.cpu_s, largest.peak_bytes / mebibyte);
  if (files.empty())
    fmt::print(stderr, "{}: contains no file, expected a corpus\n", corpus.string());
  return faults > 0 || files.empty() ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> args(argv + 1, argv + argc);
  if (args.size() == 4 && args[0] == "--program")
    return replay(args[3], [&](const fs::path& file, ProcessEnd& ended) {
      return replay_program(args[1], args[2], file, ended);
    });
  if (args.size() == 2 && targets.count(args[0]) != 0)
    return replay(args[1], [&](const fs::path& file, ProcessEnd& ended) {
      return replay_target(targets.at(args[0]), file, ended);
    });
  std::vector<std::string> names;
  for (const auto& [name, target] : targets) names.push_back(name);
  fmt::print(stderr,
             "hamelin_fuzz_replay: expected TARGET FOLDER, or --program HAMELIN EXTENSION FOLDER; "
             "targets are {}\n",
             fmt::join(names, ", "));
  return 2;
}

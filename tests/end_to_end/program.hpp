#pragma once
#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/io/file.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/test/skip.hpp"
#include "hamelin/test/temporary.hpp"

/// Runs the built program in a temporary directory.
namespace hamelin::test {

struct Output {
  int exit_code = -1;
  std::string out, err;
};

/// Sets an environment variable of this process and its children until destruction.
class EnvironmentVariable {
 public:
  EnvironmentVariable(std::string name, const std::string& value) : name_(std::move(name)) {
    ::setenv(name_.c_str(), value.c_str(), 1);
  }
  EnvironmentVariable(const EnvironmentVariable&) = delete;
  EnvironmentVariable& operator=(const EnvironmentVariable&) = delete;
  ~EnvironmentVariable() { ::unsetenv(name_.c_str()); }

 private:
  std::string name_;
};

/// A temporary working directory in which `data` links to the checkout's data; removed by the
/// destructor.
class Sandbox {
 public:
  Sandbox() {
    std::filesystem::create_directory(work_);
    std::filesystem::create_directory_symlink(std::filesystem::path(HAMELIN_SOURCE_DIR) / "data",
                                              work_ / "data");
  }
  /// Starts `hamelin arguments...` and returns its process id.
  pid_t start(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), HAMELIN_PROGRAM);
    std::vector<char*> argv;
    for (auto& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    const pid_t child = ::fork();
    if (child == 0) {
      const int in = ::open("/dev/null", O_RDONLY);
      const int out = ::open((root_ / "stdout").c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
      const int err = ::open((root_ / "stderr").c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
      if (::dup2(in, 0) < 0 || ::dup2(out, 1) < 0 || ::dup2(err, 2) < 0 ||
          ::chdir(work_.c_str()) != 0)
        ::_exit(126);
      ::unsetenv("HAMELIN_PLUGIN_PATH");
      ::execv(HAMELIN_PROGRAM, argv.data());
      ::_exit(127);
    }
    return child;
  }

  /// Waits for a child process. The exit code of a process ended by a signal is −signal.
  Output finish(pid_t child) {
    int status = 0;
    if (child < 0 || ::waitpid(child, &status, 0) != child)
      throw std::runtime_error("no child to wait for");
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status),
            read_file(root_ / "stdout"), read_file(root_ / "stderr")};
  }

  Output run(const std::vector<std::string>& arguments) { return finish(start(arguments)); }

  /// Writes a file below the working directory.
  void put(const std::filesystem::path& file, const std::string& text) {
    std::filesystem::create_directories((work_ / file).parent_path());
    std::ofstream(work_ / file, std::ios::binary) << text;
  }
  [[nodiscard]] std::filesystem::path path(const std::filesystem::path& file) const {
    return work_ / file;
  }
  [[nodiscard]] std::string text(const std::filesystem::path& file) const {
    return read_file(work_ / file);
  }
  [[nodiscard]] Json json(const std::filesystem::path& file) const {
    return read_json(work_ / file);
  }
  [[nodiscard]] bool has(const std::filesystem::path& file) const {
    return std::filesystem::exists(work_ / file);
  }

  /// The sorted paths of all files in the working directory, to find files left behind.
  [[nodiscard]] std::vector<std::string> files() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(work_))
      names.push_back(entry.path().lexically_relative(work_).string());
    std::sort(names.begin(), names.end());
    return names;
  }

 private:
  TemporaryFolder folder_;
  std::filesystem::path root_ = folder_.path(), work_ = root_ / "work";
};

/// Whether the templates of the pages were built, which takes Node.js.
inline bool pages_were_built() {
  const auto folder =
      std::filesystem::path(HAMELIN_PROGRAM).parent_path().parent_path() / "share/hamelin/report";
  return std::filesystem::exists(folder / "page.html");
}

/// Skips the test if they were not.
inline void require_pages() {
  skip_unless(pages_were_built(), "the pages were not built");
}

/// The lines of a text.
inline std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t begin = 0; begin < text.size();) {
    const auto end = std::min(text.find('\n', begin), text.size());
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return lines;
}

/// Runs with --json and checks that standard output is one JSON document and the exit code is as
/// expected.
inline Json run_json(Sandbox& sandbox, std::vector<std::string> arguments, int exit_code = 0) {
  arguments.emplace_back("--json");
  const Output output = sandbox.run(arguments);
  CAPTURE(output.err);
  REQUIRE(output.exit_code == exit_code);
  return parse_json(output.out, "standard output");
}

}  // namespace hamelin::test

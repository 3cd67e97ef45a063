// The end of runs whose planner does not return, and of processes whose parent is killed.
#include <signal.h>

#include "../program.hpp"
#include "hamelin/test/processes.hpp"

using namespace hamelin;
using test::Sandbox;

namespace {

using Strings = std::vector<std::string>;

// A program whose planners hang in their first tick, each after it made a file "hangs.PID".
class HangingProgram {
 public:
  explicit HangingProgram(Strings arguments)
      : child_(sandbox_.start(with_planner(std::move(arguments)))) {}
  HangingProgram(const HangingProgram&) = delete;
  HangingProgram& operator=(const HangingProgram&) = delete;
  ~HangingProgram() {
    for (const pid_t pid : hanging_) ::kill(pid, SIGKILL);
  }

  /// Waits until planners hang in `count` processes.
  void wait_for(std::size_t count) {
    for (int i = 0; i < 6000 && hanging_.size() < count; ++i) {
      ::usleep(10'000);
      hanging_.clear();
      for (const auto& file : sandbox_.files())
        if (file.starts_with("hangs.")) hanging_.push_back(std::stoi(file.substr(6)));
    }
    REQUIRE(hanging_.size() == count);
  }
  /// Signals the program alone, and not the processes that it started.
  test::Output end_by(int signal) {
    ::kill(child_, signal);
    // A program that does not end must not hold up the test, so it is killed after a minute.
    if (!test::has_ended(child_)) ::kill(child_, SIGKILL);
    return sandbox_.finish(child_);
  }
  [[nodiscard]] bool none_left() const {
    return std::all_of(hanging_.begin(), hanging_.end(), test::has_ended);
  }

 private:
  static Strings with_planner(Strings arguments) {
    arguments.insert(arguments.end(), {"--plugin-path", HAMELIN_TEST_ONLY_PLUGIN_DIR});
    return arguments;
  }

  test::EnvironmentVariable breaks_{"HAMELIN_TEST_BREAKS", "interruption"};
  Sandbox sandbox_;
  std::vector<pid_t> hanging_;
  pid_t child_;
};

const std::string gyro_scene = "data/scenes/paper_52_gyro.json";

// The command that executes a sweep of two runs.
Strings sweep_of_hanging_runs(const std::filesystem::path& directory) {
  Sandbox sandbox;
  const auto planned =
      sandbox.run({"sweep", "plan", gyro_scene, "--planner", "unruly", "--seeds", "1,2", "-o",
                   directory.string(), "--plugin-path", HAMELIN_TEST_ONLY_PLUGIN_DIR});
  CAPTURE(planned.err);
  REQUIRE(planned.exit_code == 0);
  return {"sweep", "run", directory.string(), "--jobs", "2"};
}

}  // namespace

TEST_CASE("one Ctrl-C ends a run whose planner does not return, with one line", "[end_to_end]") {
  HangingProgram program(
      {"--quiet", "run", gyro_scene, "--planner", "unruly", "--log", "run.jsonl"});
  program.wait_for(1);
  const auto output = program.end_by(SIGINT);
  CHECK(output.exit_code == 130);
  CHECK(output.err ==
        "hamelin: interrupted: the run did not stop within 2 s and was ended; its log, if any, is "
        "unfinished\n");
}

TEST_CASE("one Ctrl-C ends a sweep whose planners do not return", "[end_to_end]") {
  const test::TemporaryFolder folder;
  HangingProgram program(sweep_of_hanging_runs(folder.path() / "tries"));
  program.wait_for(2);
  const auto output = program.end_by(SIGINT);
  CHECK(output.exit_code == 130);
  CHECK_THAT(output.out, Catch::Contains("0 runs recorded now, 0 before, 2 left"));
  CHECK(program.none_left());
}

TEST_CASE("one Ctrl-C ends a benchmark whose planners do not return", "[end_to_end]") {
  HangingProgram program({"bench", "run", "--per-family", "1", "--family", "shelf", "--planner",
                          "unruly", "-o", "out"});
  program.wait_for(1);
  CHECK(program.end_by(SIGINT).exit_code == 130);
  CHECK(program.none_left());
}

TEST_CASE("a sweep that is killed leaves no process behind", "[end_to_end]") {
  const test::TemporaryFolder folder;
  HangingProgram program(sweep_of_hanging_runs(folder.path() / "tries"));
  program.wait_for(2);
  CHECK(program.end_by(SIGKILL).exit_code == -SIGKILL);
  CHECK(program.none_left());
}

#pragma once
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/sweep/plan.hpp"
#include "hamelin/sweep/records.hpp"
#include "hamelin/sweep/run_sweep.hpp"
#include "hamelin/test/temporary.hpp"

namespace hamelin::sweep {

/// A sweep of runs r0, r1, … of one scene, in a temporary directory. A shell script takes the place
/// of the program.
class ScriptedSweep {
 public:
  explicit ScriptedSweep(std::size_t runs) {
    std::filesystem::create_directory(root_ / "scenes");
    put("scenes/a.json", "a scene");
    plan.scenes.push_back({"scenes/a.json", sha256_hex("a scene"), true, ""});
    for (std::size_t i = 0; i < runs; ++i) {
      PlannedRun run;
      run.id = "r" + std::to_string(i);
      run.scene = "scenes/a.json";
      run.planner = "p" + std::to_string(i);
      run.set = {"/step_s=0.002"};
      run.seed = i;
      run.labels = {{"planner", "p"}, {"goal", "joint"}};
      plan.runs.push_back(run);
    }
    write_plan(plan, root_);
    script("");
  }
  /// Sets the commands that a run executes before it prints its line. $3 is the planner's name.
  /// Each call of the script appends a line to the file "calls".
  void script(const std::string& body) {
    put("program.sh",
        "echo \"$*\" >> '" + (root_ / "calls").string() + "'\n" + body +
            "\necho '{\"result\": {\"outcome\": \"reached\", \"cause\": null, \"time_s\": 2.5}, "
            "\"judge\": "
            "{\"contact\": false, \"obstacles\": null, \"self\": null, \"configurations\": 3}}'\n");
  }
  void put(const std::filesystem::path& file, const std::string& text) const {
    folder_.put(file, text);
  }
  [[nodiscard]] RunOptions options() const {
    RunOptions options;
    options.command = {"/bin/sh", (root_ / "program.sh").string()};
    options.jobs = 2;
    return options;
  }
  [[nodiscard]] const std::filesystem::path& root() const { return root_; }
  [[nodiscard]] std::vector<std::string> lines(const std::filesystem::path& file) const {
    std::ifstream in(root_ / file);
    std::vector<std::string> all;
    for (std::string line; std::getline(in, line);) all.push_back(line);
    return all;
  }
  [[nodiscard]] std::vector<Json> records() const {
    std::vector<Json> all;
    for (const auto& file : record_files(root_))
      (void)read_records(file, RunIndex(plan),
                         [&](PlacedRecord&& placed) { all.push_back(std::move(placed.record)); });
    return all;
  }
  [[nodiscard]] bool truncated() const {
    return read_records(records_file(root_), RunIndex(plan), [](PlacedRecord&&) {}).truncated;
  }
  [[nodiscard]] std::string message(const RunOptions& with) const {
    try {
      (void)run_sweep(root_, with);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  Plan plan;

 private:
  test::TemporaryFolder folder_;
  std::filesystem::path root_ = folder_.path();
};

}  // namespace hamelin::sweep

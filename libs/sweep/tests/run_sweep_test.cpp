#include "hamelin/sweep/run_sweep.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "../src/file_lock.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/sweep/make_plan.hpp"
#include "hamelin/sweep/merge.hpp"
#include "hamelin/sweep/plan.hpp"
#include "hamelin/sweep/records.hpp"
#include "hamelin/test/processes.hpp"
#include "scripted_sweep.hpp"

using namespace hamelin;
using namespace hamelin::sweep;

namespace fs = std::filesystem;

TEST_CASE("a plan reads back as it was written", "[sweep][unit]") {
  ScriptedSweep sweep(3);
  const Plan read = read_plan(sweep.root());
  CHECK(to_json(read) == to_json(sweep.plan));
  CHECK(read.sha256 == sweep.plan.sha256);
  CHECK(run_arguments(read.runs[2], "dir") ==
        std::vector<std::string>{"dir/scenes/a.json", "--planner", "p2", "--set", "/step_s=0.002",
                                 "--seed", "2"});
}

TEST_CASE("an invalid plan is refused with file and place", "[sweep][unit]") {
  ScriptedSweep sweep(2);
  const auto message = [&](const Json& document) {
    sweep.put("plan.json", document.dump());
    try {
      (void)read_plan(sweep.root());
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const Json good = to_json(sweep.plan);
  Json doubled = good, elsewhere = good, unfinished = good;
  doubled["runs"][1]["id"] = "r0";
  elsewhere["runs"][0]["scene"] = "scenes/b.json";
  unfinished["runs"][0].erase("seed");
  CHECK_THAT(message(doubled),
             Catch::EndsWith("plan.json: /runs/1/id: 'r0' occurs twice, expected unique ids"));
  CHECK_THAT(message(elsewhere),
             Catch::Contains("plan.json: /runs/0/scene: 'scenes/b.json' is not among the scenes"));
  CHECK_THAT(message(unfinished), Catch::Contains("plan.json: /runs/0"));
  CHECK_THROWS_WITH(read_plan("/no/such/directory"),
                    Catch::Contains("/no/such/directory: is not a directory"));
}

TEST_CASE("each run of a plan is recorded once, and a second call has nothing to do",
          "[sweep][unit]") {
  ScriptedSweep sweep(7);
  std::size_t reported = 0;
  RunOptions options = sweep.options();
  options.on_done = [&](std::size_t done, std::size_t all) {
    CHECK(done == ++reported);
    CHECK(all == 7);
  };
  const auto outcome = run_sweep(sweep.root(), options);
  CHECK(outcome.run == 7);
  CHECK(reported == 7);
  const std::vector<Json> records = sweep.records();
  REQUIRE(records.size() == 7);
  std::set<std::string> ids;
  for (const auto& line : records) {
    check_shipped_schema(line, "record", "record");
    ids.insert(line["id"]);
    CHECK(line["outcome"] == "reached");
    CHECK(line["result"]["time_s"] == 2.5);
    CHECK(line["labels"] == Json{{"goal", "joint"}, {"planner", "p"}});
  }
  CHECK(ids.size() == 7);
  const auto again = run_sweep(sweep.root(), sweep.options());
  CHECK(again.run == 0);
  CHECK(again.recorded == 7);
  CHECK(sweep.lines("calls").size() == 7);
}

TEST_CASE("runs in forks have a process, a group, outputs and files of their own",
          "[sweep][unit]") {
  ScriptedSweep sweep(5);
  const pid_t parent = ::getpid();
  std::printf("buffered before the forks ");  // would be in the output of each run
  RunOptions options = sweep.options();
  options.main = [parent](const std::vector<std::string>& command) {
    const std::string& planner = command.at(4);
    const bool own = ::getpid() != parent && ::getpgrp() == ::getpid();
    const bool inherits = ::fcntl(STDERR_FILENO + 1, F_GETFD) >= 0;  // for example the lock
    if (planner == "p1") {
      ::signal(SIGSEGV, SIG_DFL);  // without the handlers of Catch and of sanitizers
      ::raise(SIGSEGV);
    }
    if (planner == "p2") {
      std::fprintf(stderr, "no such joint\n");
      return 3;
    }
    if (planner == "p3") throw std::runtime_error("unexpected");
    std::printf(
        R"({"result": {"outcome": "reached", "cause": null, "time_s": %d}, )"
        R"("judge": {"contact": false, "obstacles": null, "self": null, "configurations": 3}})",
        own && !inherits ? 1 : 0);
    return 0;
  };
  const auto outcome = run_sweep(sweep.root(), options);
  CHECK(outcome.run == 5);
  CHECK(outcome.crashed == 3);
  CHECK(sweep.lines("calls").empty());  // no program was started
  for (const auto& line : sweep.records()) {
    const std::string id = line["id"];
    if (id == "r0" || id == "r4") {
      CHECK(line["outcome"] == "reached");
      CHECK(line["result"]["time_s"] == 1);
    }
    if (id == "r1") CHECK(line["crash"] == Json{{"signal", SIGSEGV}, {"exit_code", nullptr}});
    if (id == "r2") CHECK(line["cause"] == "exit code 3: no such joint");
    if (id == "r3") CHECK(line["cause"] == "exit code 3");
  }
}

TEST_CASE("only the run of a truncated last line is repeated", "[sweep][unit]") {
  ScriptedSweep sweep(6);
  RunOptions some = sweep.options();
  some.limit = 4;
  some.jobs = 1;
  CHECK(run_sweep(sweep.root(), some).run == 4);
  const fs::path file = records_file(sweep.root());
  const std::string text = read_file(file);
  fs::resize_file(file, text.size() - 40);
  CHECK(sweep.truncated());
  const auto outcome = run_sweep(sweep.root(), sweep.options());
  CHECK(outcome.dropped_truncated_line);
  CHECK(outcome.recorded == 3);
  CHECK(outcome.run == 3);
  CHECK_FALSE(sweep.truncated());
  CHECK(sweep.records().size() == 6);
  CHECK(sweep.lines("calls").size() == 7);
  CHECK(read_file(file).substr(0, text.size() / 2) == text.substr(0, text.size() / 2));
}

TEST_CASE("a run that crashes is recorded with its signal or exit code, and the others continue",
          "[sweep][unit]") {
  ScriptedSweep sweep(4);
  sweep.script(
      "case \"$3\" in p1) echo torn >&2; kill -SEGV $$;; p2) echo 'hamelin: internal error: oh' "
      ">&2; exit 3;; esac");
  const auto outcome = run_sweep(sweep.root(), sweep.options());
  CHECK(outcome.run == 4);
  CHECK(outcome.crashed == 2);
  for (const auto& line : sweep.records()) {
    check_shipped_schema(line, "record", "record");
    const std::string id = line["id"];
    CHECK(line["outcome"] == (id == "r1" || id == "r2" ? "crashed" : "reached"));
    if (id == "r1") CHECK(line["crash"] == Json{{"signal", 11}, {"exit_code", nullptr}});
    if (id == "r1") CHECK_THAT(line["cause"].get<std::string>(), Catch::EndsWith("torn"));
    if (id == "r2") CHECK(line["crash"] == Json{{"signal", nullptr}, {"exit_code", 3}});
    if (id == "r2") CHECK(line["cause"] == "exit code 3: internal error: oh");
  }
}

TEST_CASE("bad input that a run finds ends the sweep and is not recorded", "[sweep][unit]") {
  ScriptedSweep sweep(5);
  sweep.script(
      "if [ \"$3\" = p2 ]; then echo 'hamelin: note: x' >&2; echo 'hamelin: a.json: /q: is bad' "
      ">&2; exit 2; fi");
  RunOptions options = sweep.options();
  options.jobs = 1;
  CHECK(sweep.message(options) == "run 'r2': a.json: /q: is bad");
  CHECK(sweep.records().size() == 2);
  CHECK(sweep.lines("calls").size() == 3);
}

TEST_CASE("contact that the judge saw turns the outcome reached into collision", "[sweep][unit]") {
  ScriptedSweep sweep(1);
  sweep.put("program.sh",
            "echo '{\"result\": {\"outcome\": \"reached\", \"cause\": null}, \"judge\": "
            "{\"contact\": true, \"obstacles\": "
            "{\"clearance_m\": -0.01, \"time_s\": 1, \"sphere\": \"a/0\", \"other\": \"b\"}, "
            "\"self\": null, "
            "\"configurations\": 3}}'\n");
  (void)run_sweep(sweep.root(), sweep.options());
  const Json record = sweep.records().at(0);
  CHECK(record["outcome"] == "collision");
  CHECK(record["result"]["outcome"] == "reached");
}

TEST_CASE("a stopped sweep terminates its children, does not record them, and can be resumed",
          "[sweep][unit]") {
  ScriptedSweep sweep(4);
  sweep.script("if [ \"$3\" != p0 ]; then exec sleep 60; fi");
  std::atomic<bool> stop{false};
  RunOptions options = sweep.options();
  options.stop = &stop;
  options.on_done = [&](std::size_t, std::size_t) { stop = true; };
  const auto outcome = run_sweep(sweep.root(), options);
  CHECK(outcome.stopped);
  CHECK(outcome.run == 1);
  CHECK(sweep.records().size() == 1);
  sweep.script("");
  CHECK(run_sweep(sweep.root(), sweep.options()).run == 3);
}

TEST_CASE("children that do not end when they are asked to are killed", "[sweep][unit]") {
  ScriptedSweep sweep(3);
  const fs::path root = sweep.root();
  sweep.script("if [ \"$3\" = p0 ]; then while [ ! -e '" + (root / "p1").string() +
               "' ]; do sleep 0.01; done; else trap '' TERM; touch '" + root.string() +
               "'/$3; i=0; while [ $i -lt 60 ]; do sleep 1; i=$((i + 1)); done; touch '" +
               (root / "late").string() + "'; fi");
  std::atomic<bool> stop{false};
  RunOptions options = sweep.options();
  options.stop = &stop;
  options.on_done = [&](std::size_t, std::size_t) { stop = true; };
  CHECK(run_sweep(root, options).stopped);
  CHECK_FALSE(fs::exists(root / "late"));
  CHECK(sweep.records().size() == 1);
}

TEST_CASE("the runs of a sweep that is killed are killed", "[sweep][unit]") {
  const bool in_forks = GENERATE(false, true);
  CAPTURE(in_forks);
  ScriptedSweep sweep(2);
  const std::string pids = (sweep.root() / "pids").string();
  sweep.script("echo $$ >> '" + pids + "'; exec sleep 600");
  RunOptions options = sweep.options();
  if (in_forks)
    options.main = [&pids](const std::vector<std::string>&) {
      std::ofstream(pids, std::ios::app) << ::getpid() << std::endl;
      ::sleep(600);
      return 0;
    };
  const pid_t parent = ::fork();
  if (parent == 0) {
    (void)run_sweep(sweep.root(), options);
    ::_exit(0);
  }
  for (int i = 0; i < 6000 && sweep.lines("pids").size() < 2; ++i) ::usleep(10'000);
  ::kill(parent, SIGKILL);
  CHECK(::waitpid(parent, nullptr, 0) == parent);
  const auto running = sweep.lines("pids");
  REQUIRE(running.size() == 2);
  for (const auto& pid : running) {
    CHECK(test::has_ended(std::stoi(pid)));
    ::kill(std::stoi(pid), SIGKILL);
  }
}

TEST_CASE("a program that cannot be started is an error that names it", "[sweep][unit]") {
  ScriptedSweep sweep(1);
  RunOptions options = sweep.options();
  options.command = {"/no/such/program"};
  CHECK(sweep.message(options) == "/no/such/program: cannot be started: No such file or directory");
}

TEST_CASE("a run that takes too long is killed and recorded, and the others continue",
          "[sweep][unit]") {
  ScriptedSweep sweep(3);
  sweep.script("if [ \"$3\" = p1 ]; then exec sleep 600; fi");
  RunOptions options = sweep.options();
  options.timeout_s = 0.5;
  const RunOutcome outcome = run_sweep(sweep.root(), options);
  CHECK(outcome.run == 3);
  CHECK(outcome.crashed == 1);
  for (const Json& record : sweep.records()) {
    CHECK(record["outcome"] == (record["id"] == "r1" ? "crashed" : "reached"));
    if (record["id"] != "r1") continue;
    CHECK(record["cause"] == "killed after 0.5 s");
    CHECK(record["crash"]["signal"] == SIGKILL);
  }
}

TEST_CASE("a process that a run leaves behind does not delay the sweep, and is killed",
          "[sweep][unit]") {
  ScriptedSweep sweep(2);
  // it keeps standard output and error open, as a process forked by a plugin would
  sweep.script("sleep 600 & echo $! >> '" + (sweep.root() / "left").string() + "'");
  const auto begin = std::chrono::steady_clock::now();
  const RunOutcome outcome = run_sweep(sweep.root(), sweep.options());
  CHECK(std::chrono::steady_clock::now() - begin < std::chrono::seconds(300));
  CHECK(outcome.run == 2);
  CHECK(outcome.crashed == 0);
  const auto left = sweep.lines("left");
  REQUIRE(left.size() == 2);
  for (const auto& pid : left) CHECK(test::has_ended(std::stoi(pid)));
}

TEST_CASE("the processes of a run that is killed after its time limit are killed with it",
          "[sweep][unit]") {
  ScriptedSweep sweep(1);
  sweep.script("sleep 600 & sleep 600");
  RunOptions options = sweep.options();
  options.timeout_s = 0.3;
  CHECK(run_sweep(sweep.root(), options).crashed == 1);
  CHECK(sweep.records().at(0)["cause"] == "killed after 0.3 s");
}

TEST_CASE("everything that a run writes before it ends is read", "[sweep][unit]") {
  ScriptedSweep sweep(3);
  // more than a pipe holds, with the line of JSON at the end
  sweep.put("program.sh",
            "head -c 200000 /dev/zero | tr '\\0' ' '\n"
            "echo '{\"result\": {\"outcome\": \"reached\", \"cause\": null}, \"judge\": null}'\n");
  CHECK(run_sweep(sweep.root(), sweep.options()).crashed == 0);
}

TEST_CASE("a plan is not made while a sweep runs in its directory", "[sweep][unit]") {
  ScriptedSweep sweep(1);
  PlanOptions options;
  options.files = {std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/scenes/paper_52_apf.json"};
  options.plugin_directories = {HAMELIN_TEST_PLUGIN_DIR};
  const std::string before = read_file(plan_file(sweep.root()));
  const DirectoryLock lock(sweep.root());
  CHECK_THROWS_WITH(make_plan(sweep.root(), options),
                    Catch::Contains("another sweep command is using it"));
  CHECK(read_file(plan_file(sweep.root())) == before);
}

TEST_CASE("two sweeps at a time in one directory are refused", "[sweep][unit]") {
  ScriptedSweep sweep(2);
  RunOptions options = sweep.options();
  options.jobs = 1;
  std::string second;
  options.on_done = [&](std::size_t, std::size_t) { second = sweep.message(sweep.options()); };
  CHECK(run_sweep(sweep.root(), options).run == 2);
  CHECK_THAT(second, Catch::EndsWith("records.jsonl: another sweep command is using it, expected "
                                     "one at a time per directory"));
}

TEST_CASE("runs are selected by a part of their id", "[sweep][unit]") {
  ScriptedSweep sweep(12);
  RunOptions options = sweep.options();
  options.only = "r1";
  CHECK(run_sweep(sweep.root(), options).run == 3);  // r1, r10, r11
  options.only = "r99";
  CHECK_THAT(sweep.message(options), Catch::Contains("no run id contains 'r99'"));
}

TEST_CASE(
    "records of another plan, duplicate or broken records, and changed scenes are refused with the "
    "reason",
    "[sweep][unit]") {
  ScriptedSweep sweep(3);
  (void)run_sweep(sweep.root(), sweep.options());
  const auto message = [&] { return sweep.message(sweep.options()); };
  const std::string text = read_file(records_file(sweep.root()));
  sweep.put("records.jsonl", text + text.substr(0, text.find('\n') + 1));
  CHECK_THAT(message(),
             Catch::Contains("records.jsonl: line 4: run 'r") && Catch::Contains("recorded twice"));
  sweep.put("records.jsonl", "{\"schema\": \"hamelin.record/1\"}\n" + text);
  CHECK_THAT(message(), Catch::Contains("records.jsonl: line 1: is not a record"));
  sweep.put("records.jsonl", "{\n" + text);
  CHECK_THAT(message(), Catch::Contains("records.jsonl: line 1"));
  sweep.put("records.jsonl", text);
  Plan other = sweep.plan;
  other.runs.pop_back();
  CHECK_THROWS_WITH(write_plan(other, sweep.root()),
                    Catch::Contains("records.jsonl: holds records of another plan"));
  sweep.put("plan.json", to_json(other).dump());
  CHECK_THAT(message(), Catch::Contains("records.jsonl: line 1: belongs to another plan"));
  RunOptions fresh = sweep.options();
  fresh.fresh = true;
  CHECK(run_sweep(sweep.root(), fresh).run == 2);
  sweep.put("scenes/a.json", "another scene");
  CHECK_THAT(sweep.message(fresh),
             Catch::Contains("a.json: has changed since the sweep was planned: SHA-256 "));
}

TEST_CASE("a sweep is not resumed with inputs or planners that have changed", "[sweep][unit]") {
  ScriptedSweep sweep(3);
  sweep.put("map.bt", "a map");
  sweep.put("quick.hamelin.so", "a planner");
  const std::string planner = (sweep.root() / "quick.hamelin.so").string();
  sweep.plan.inputs = {{"map.bt", sha256_hex("a map")}};
  sweep.plan.plugins = {{planner, sha256_hex("a planner")}};
  write_plan(sweep.plan, sweep.root());
  CHECK(to_json(read_plan(sweep.root())) == to_json(sweep.plan));
  RunOptions some = sweep.options();
  some.limit = 1;
  CHECK(run_sweep(sweep.root(), some).run == 1);
  sweep.put("map.bt", "another map");
  CHECK(sweep.message(sweep.options()) ==
        (sweep.root() / "map.bt").string() + ": has changed since the sweep was planned: SHA-256 " +
            sha256_hex("another map") + ", expected " + sha256_hex("a map") +
            "; plan it again, in a new directory if there are records");
  sweep.put("map.bt", "a map");
  sweep.put("quick.hamelin.so", "another planner");
  CHECK_THAT(sweep.message(sweep.options()),
             Catch::StartsWith(planner + ": has changed since the sweep was planned"));
  sweep.plan.plugins = {{"gone", sha256_hex("a planner")}};
  sweep.put("quick.hamelin.so", "a planner");
  CHECK(run_sweep(sweep.root(), sweep.options()).run == 2);
}

TEST_CASE("the same plan gives the same records in any order, independent of the number of jobs",
          "[sweep][unit]") {
  std::vector<std::multiset<std::string>> found;
  for (const std::size_t jobs : {1U, 4U}) {
    ScriptedSweep sweep(9);
    sweep.script("case \"$3\" in p[0-3]) sleep 0.05;; esac");
    RunOptions options = sweep.options();
    options.jobs = jobs;
    (void)run_sweep(sweep.root(), options);
    const auto lines = sweep.lines("records.jsonl");
    found.emplace_back(lines.begin(), lines.end());
  }
  CHECK(found[0].size() == 9);
  CHECK(found[0] == found[1]);
}

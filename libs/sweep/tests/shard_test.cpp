#include "hamelin/sweep/shard.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <set>
#include <string>
#include <vector>

#include "hamelin/sweep/merge.hpp"
#include "scripted_sweep.hpp"

using namespace hamelin;
using namespace hamelin::sweep;

namespace {

namespace fs = std::filesystem;

/// Each run takes a little while and its result depends on the run alone, but for its timing.
void script_results(const ScriptedSweep& sweep) {
  sweep.put("program.sh",
            "n=${3#p}; sleep 0.0$((n % 3))\n"
            "if [ $n = 5 ]; then echo oh >&2; exit 3; fi\n"
            "echo '{\"result\": {\"outcome\": \"reached\", \"cause\": null, \"time_s\": '$n'.5, "
            "\"timing\": {\"tick_us\": {\"p50\": '$$', \"p99\": 1}}}, "
            "\"judge\": {\"contact\": false, \"obstacles\": null, \"self\": null, "
            "\"configurations\": 3}}'\n");
}

/// What a merge writes without timing: the records and the summary.
std::string merged_bytes(const std::vector<fs::path>& directories) {
  const Merged merged = merge(read_sweeps(directories, false), {"planner"});
  CHECK(merged.notes == std::vector<std::string>{});
  const fs::path file = directories.front() / "merged.jsonl";
  write_records(merged.sweeps, file, false);
  return read_file(file) + to_json(merged).dump() + to_table(merged);
}

void run_shards(const ScriptedSweep& sweep, std::size_t count) {
  for (std::size_t i = 1; i <= count; ++i) {
    RunOptions options = sweep.options();
    options.shard = Shard{i, count};
    (void)run_sweep(sweep.root(), options);
  }
}

/// Runs a shard in a process of its own and kills it after a while, with its children.
void run_and_kill(const ScriptedSweep& sweep, const Shard& shard, useconds_t after_us) {
  const pid_t pid = ::fork();
  REQUIRE(pid >= 0);
  if (pid == 0) {
    ::setpgid(0, 0);
    RunOptions options = sweep.options();
    options.shard = shard;
    try {
      (void)run_sweep(sweep.root(), options);
    } catch (...) {
      ::_exit(1);
    }
    ::_exit(0);
  }
  ::usleep(after_us);
  ::kill(pid, SIGKILL);
  int status = 0;
  ::waitpid(pid, &status, 0);
}

}  // namespace

TEST_CASE("a shard is read from its text, and anything else is refused", "[sweep][unit]") {
  const Shard shard = parse_shard("3/40", "--shard");
  CHECK(shard.index == 3);
  CHECK(shard.count == 40);
  CHECK(to_string(shard) == "3/40");
  for (const char* text : {"", "3", "/", "3/", "/40", "0/4", "5/4", "-1/4", "1/0", "a/b", "1/4x",
                           " 1/4", "1/ 4", "1/100001", "1/99999999999999999999", "1/4/2"})
    CHECK_THROWS_WITH(parse_shard(text, "--shard"),
                      "--shard: '" + std::string(text) +
                          "' is not a shard, expected I/N with 1 <= I <= N <= 100000, as in 3/40");
}

TEST_CASE("each run belongs to one shard, and shards are of equal size", "[sweep][unit]") {
  Plan plan;
  for (std::size_t i = 0; i < 1000; ++i) {
    PlannedRun run;
    run.id = "scene_" + std::to_string(i / 2) + (i % 2 == 0 ? "/hybrid" : "/mppi");
    plan.runs.push_back(run);
  }
  for (const std::size_t count : {1U, 2U, 7U, 40U, 1000U, 1500U}) {
    CAPTURE(count);
    std::multiset<std::size_t> all;
    std::size_t least = 1000, most = 0;
    for (std::size_t i = 1; i <= count; ++i) {
      const auto runs = runs_of_shard(plan, {i, count});
      CHECK(std::is_sorted(runs.begin(), runs.end()));
      all.insert(runs.begin(), runs.end());
      least = std::min(least, runs.size());
      most = std::max(most, runs.size());
    }
    CHECK(all.size() == 1000);
    CHECK(std::set<std::size_t>(all.begin(), all.end()).size() == 1000);
    CHECK(most - least <= 1);
  }
  // every second run is of mppi; a stride of two would give all of them to one shard
  const auto half = runs_of_shard(plan, {1, 2});
  const auto mppi = std::count_if(half.begin(), half.end(), [](auto run) { return run % 2 == 1; });
  CHECK(mppi > 200);
  CHECK(mppi < 300);
}

TEST_CASE("any number of shards gives the bytes of one sweep, also with shards run twice",
          "[sweep][unit]") {
  std::string expected;
  {
    ScriptedSweep sweep(40);
    script_results(sweep);
    (void)run_sweep(sweep.root(), sweep.options());
    expected = merged_bytes({sweep.root()});
  }
  for (const std::size_t count : {1U, 7U, 40U, 50U}) {
    CAPTURE(count);
    ScriptedSweep sweep(40);
    script_results(sweep);
    run_shards(sweep, count);
    CHECK(merged_bytes({sweep.root()}) == expected);
    const std::size_t calls = sweep.records().size();
    run_shards(sweep, count);
    CHECK(sweep.records().size() == calls);
    CHECK(merged_bytes({sweep.root()}) == expected);
  }
}

TEST_CASE("shards that are killed at any time are resumed and give the same bytes",
          "[sweep][unit]") {
  ScriptedSweep whole(40), killed(40);
  script_results(whole);
  script_results(killed);
  (void)run_sweep(whole.root(), whole.options());
  for (std::size_t round = 0; round < 3; ++round)
    for (std::size_t i = 1; i <= 7; ++i)
      run_and_kill(killed, {i, 7}, static_cast<useconds_t>(5'000 + 17'000 * ((i + round) % 5)));
  run_shards(killed, 7);
  CHECK(merged_bytes({killed.root()}) == merged_bytes({whole.root()}));
}

TEST_CASE("a sweep that was begun with other shards, or without, is continued", "[sweep][unit]") {
  ScriptedSweep sweep(20);
  script_results(sweep);
  RunOptions options = sweep.options();
  options.shard = Shard{2, 3};
  CHECK(run_sweep(sweep.root(), options).run == 7);
  options.shard = Shard{1, 2};
  const RunOutcome half = run_sweep(sweep.root(), options);
  CHECK(half.planned == 10);
  CHECK(half.recorded + half.run == 10);
  CHECK(half.recorded > 0);
  options.shard.reset();
  CHECK(run_sweep(sweep.root(), options).recorded == 7 + half.run);
  CHECK(sweep.records().size() == 20);
}

TEST_CASE("records of copies of a sweep are joined, and differing ones are named",
          "[sweep][unit]") {
  ScriptedSweep a(12), b(12);
  script_results(a);
  script_results(b);
  run_shards(a, 1);
  for (std::size_t i = 2; i <= 3; ++i) {
    RunOptions options = b.options();
    options.shard = Shard{i, 3};
    (void)run_sweep(b.root(), options);
  }
  const Sweeps joined = read_sweeps({a.root(), b.root(), a.root()});
  CHECK(joined.runs.size() == 12);
  CHECK(joined.repeated == 8);
  CHECK(joined.different.empty());
  CHECK(merged_bytes({a.root(), b.root()}) == merged_bytes({a.root()}));

  // b found another time for one of its runs
  const std::size_t run = runs_of_shard(b.plan, {2, 3}).front();
  const std::string name = "records-2-of-3.jsonl", time = fmt::format("\"time_s\":{}.5", run);
  std::string text = read_file(b.root() / name);
  b.put(name, text.replace(text.find(time), time.size(), "\"time_s\":99"));
  const Merged merged = merge(read_sweeps({a.root(), b.root()}), {"planner"});
  CHECK(merged.sweeps.different == std::vector{b.plan.runs[run].id});
  CHECK(merged.sweeps.runs[run].facts.time_s == static_cast<double>(run) + 0.5);
  CHECK(merged.notes.back() ==
        fmt::format("1 runs have different records in several files, the first of them is '{}'; "
                    "the first record of each is used",
                    b.plan.runs[run].id));
}

TEST_CASE("a record of a crash gives way to one of a run that ended", "[sweep][unit]") {
  ScriptedSweep a(2), b(2);
  a.script("if [ \"$3\" = p1 ]; then exit 9; fi");
  run_shards(a, 1);
  run_shards(b, 1);
  for (const auto& order : {std::vector{a.root(), b.root()}, std::vector{b.root(), a.root()}}) {
    const Sweeps joined = read_sweeps(order);
    CHECK(joined.runs[1].facts.outcome == "reached");
    CHECK(joined.different == std::vector<std::string>{"r1"});
  }
}

TEST_CASE("a run that another process kills is repeated once", "[sweep][unit]") {
  ScriptedSweep sweep(3);
  const std::string mark = (sweep.root() / "mark").string();
  sweep.script("if [ \"$3\" = p1 ] && [ ! -e '" + mark + "' ]; then touch '" + mark +
               "'; kill -KILL $$; fi");
  const RunOutcome outcome = run_sweep(sweep.root(), sweep.options());
  CHECK(outcome.run == 3);
  CHECK(outcome.crashed == 0);
  CHECK(sweep.lines("calls").size() == 4);

  ScriptedSweep always(3);
  always.script("if [ \"$3\" = p1 ]; then kill -TERM $$; fi");
  CHECK(run_sweep(always.root(), always.options()).crashed == 1);
  CHECK(always.lines("calls").size() == 4);
}

TEST_CASE("shards may run at the same time, but not one twice, nor beside a whole sweep",
          "[sweep][unit]") {
  ScriptedSweep sweep(6);
  RunOptions first = sweep.options(), second = sweep.options();
  first.jobs = 1;
  first.shard = Shard{1, 2};
  second.shard = Shard{2, 2};
  std::string same, whole;
  std::size_t other = 0;
  first.on_done = [&](std::size_t done, std::size_t) {
    if (done > 1) return;
    other = run_sweep(sweep.root(), second).run;
    same = sweep.message(first);
    whole = sweep.message(sweep.options());
  };
  CHECK(run_sweep(sweep.root(), first).run == 3);
  CHECK(other == 3);
  CHECK_THAT(same, Catch::EndsWith("records-1-of-2.jsonl: another sweep command is using it, "
                                   "expected one at a time per shard"));
  CHECK_THAT(whole, Catch::EndsWith("records.jsonl: another sweep command is using it, expected "
                                    "one at a time per directory"));
}

TEST_CASE("records of shards are dropped by a fresh sweep, and a fresh shard is refused",
          "[sweep][unit]") {
  ScriptedSweep sweep(5);
  run_shards(sweep, 2);
  RunOptions options = sweep.options();
  options.fresh = true;
  options.shard = Shard{1, 2};
  CHECK_THAT(sweep.message(options), Catch::Contains("a shard cannot drop the records"));
  CHECK(record_files(sweep.root()).size() == 3);
  options.shard.reset();
  CHECK(run_sweep(sweep.root(), options).run == 5);
  CHECK(record_files(sweep.root()).size() == 1);
  Plan other = sweep.plan;
  other.runs.pop_back();
  run_shards(sweep, 3);
  CHECK_THROWS_WITH(write_plan(other, sweep.root()), Catch::Contains("holds records of another"));
}

TEST_CASE("files with similar names are not files of records", "[sweep][unit]") {
  ScriptedSweep sweep(1);
  (void)run_sweep(sweep.root(), sweep.options());
  for (const char* name : {"records-all.jsonl", "records-1-of.jsonl", "records--of-2.jsonl",
                           "recordsx.jsonl", "records-1-of-2.jsonl.bak", "records-1-of-2x.jsonl"})
    sweep.put(name, "no record\n");
  CHECK(record_files(sweep.root()) == std::vector{records_file(sweep.root())});
  CHECK(read_sweeps({sweep.root()}).runs.size() == 1);
}

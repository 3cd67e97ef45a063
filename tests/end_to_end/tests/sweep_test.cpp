// Sweeps: planning, running with one process per run, resuming after a kill, and summarising.
#include <signal.h>

#include <chrono>
#include <set>
#include <thread>

#include "../program.hpp"

using namespace hamelin;
using test::lines_of;
using test::Sandbox;

namespace {

/// Plans runs of example 5.2 and of arm7 in its shelf.
void plan(Sandbox& sandbox, const std::vector<std::string>& more = {}) {
  std::vector<std::string> arguments{
      "sweep", "plan", "data/scenes/paper_52_gyro.json", "data/scenes/paper_52_apf.json",
      "-o",    "tries"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const auto output = sandbox.run(arguments);
  CAPTURE(output.err);
  REQUIRE(output.exit_code == 0);
}

// A record without the parts that depend on clock and machine.
Json reproducible(const std::string& line) {
  Json record = parse_json(line, "record");
  record["result"].erase("timing");
  record["result"].erase("provenance");
  return record;
}

std::multiset<std::string> reproducible_records(Sandbox& sandbox, const std::string& file) {
  std::multiset<std::string> all;
  for (const auto& line : lines_of(sandbox.text(file))) all.insert(reproducible(line).dump());
  return all;
}

}  // namespace

TEST_CASE("a sweep is planned, run and summarised, and its files fit their schemas",
          "[end_to_end]") {
  Sandbox sandbox;
  plan(sandbox, {"--seeds", "1,2"});
  const auto run = sandbox.run({"sweep", "run", "tries"});
  CAPTURE(run.err);
  CHECK(run.exit_code == 0);
  CHECK(run.out == "tries: 4 runs recorded now, 0 before, 0 left\n");
  const auto checked = sandbox.run({"validate", "tries/plan.json", "tries/records.jsonl"});
  CAPTURE(checked.err);
  CHECK(checked.exit_code == 0);
  const Json summary =
      test::run_json(sandbox, {"sweep", "merge", "tries", "--by", "problem", "-o", "summary.json"});
  CHECK(summary == sandbox.json("summary.json"));
  CHECK(sandbox.run({"validate", "summary.json"}).out == "summary.json: ok (sweep summary)\n");
  REQUIRE(summary["groups"].size() == 2);
  const Json &apf = summary["groups"][0], &gyro = summary["groups"][1];
  CHECK(apf["labels"]["problem"] == "paper_52_apf");
  CHECK(apf["outcomes"] == Json{{"stalled", 2}});
  CHECK(gyro["reached"] == 2);
  CHECK(gyro["contacts"] == 0);
  CHECK(gyro["judged"] == 2);
  CHECK(gyro["min_clearance_m"].get<double>() > 0.0);
  const auto table = sandbox.run({"sweep", "merge", "tries"});
  CHECK(table.exit_code == 0);
  CHECK_THAT(table.out, Catch::Contains("did not reach"));
}

TEST_CASE("the page of a sweep is one self-contained file, or one line says why there is none",
          "[end_to_end]") {
  Sandbox sandbox;
  plan(sandbox);
  REQUIRE(sandbox.run({"sweep", "run", "tries"}).exit_code == 0);
  const auto output = sandbox.run({"sweep", "merge", "tries", "--page", "page.html"});
  CAPTURE(output.err);
  if (!test::pages_were_built()) {
    CHECK(output.exit_code == 2);
    CHECK(lines_of(output.err).size() == 1);
    CHECK_THAT(output.err, Catch::Contains("sweep.html: is missing: the page was not built"));
    CHECK_FALSE(sandbox.has("page.html"));
    return;
  }
  CHECK(output.exit_code == 0);
  const std::string page = sandbox.text("page.html");
  CHECK(page.size() < 200'000);
  CHECK_THAT(page, Catch::Contains("default-src 'none'") &&
                       Catch::Contains("<title>hamelin sweep</title>"));
  CHECK(page.find("<script src") == std::string::npos);
  CHECK(page.find("<link ") == std::string::npos);
  REQUIRE(sandbox.run({"sweep", "merge", "tries", "--page", "again.html"}).exit_code == 0);
  CHECK(sandbox.text("again.html") == page);
}

TEST_CASE("a sweep is not resumed with another map or robot than was planned", "[end_to_end]") {
  Sandbox sandbox;
  sandbox.put("map.bt",
              read_file(std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/maps/clutter.bt"));
  sandbox.put("robot.urdf",
              read_file(std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/robots/arm7.urdf"));
  Json scene = sandbox.json("data/scenes/clutter.json");
  scene["robot"] = {
      {"file", "robot.urdf"}, {"tip", "flange"}, {"spheres", "data/robots/arm7.spheres.json"}};
  scene["map"] = {{"file", "map.bt"}};
  scene["duration_s"] = 0.1;
  scene["obstacles"] = Json::array();
  sandbox.put("scene.json", scene.dump());
  const auto planned =
      sandbox.run({"sweep", "plan", "scene.json", "--seeds", "1,2", "-o", "tries"});
  CAPTURE(planned.err);
  REQUIRE(planned.exit_code == 0);
  CHECK(sandbox.run({"sweep", "run", "tries", "--limit", "1"}).exit_code == 0);
  for (const char* file : {"map.bt", "robot.urdf"}) {
    const std::string bytes = sandbox.text(file);
    sandbox.put(file, bytes + " ");
    const auto output = sandbox.run({"sweep", "run", "tries"});
    CHECK(output.exit_code == 2);
    CHECK(lines_of(output.err).size() == 1);
    CHECK_THAT(output.err,
               Catch::Contains(std::string(file) + ": has changed since the sweep was planned"));
    sandbox.put(file, bytes);
  }
  CHECK(sandbox.run({"sweep", "run", "tries"}).out ==
        "tries: 1 runs recorded now, 1 before, 0 left\n");
}

TEST_CASE("a killed sweep resumes, and its records equal those of an uninterrupted sweep",
          "[end_to_end]") {
  Sandbox sandbox;
  plan(sandbox, {"--seeds", "1,2,3"});
  const pid_t child = sandbox.start({"sweep", "run", "tries", "--jobs", "1"});
  const auto recorded = [&] {
    return sandbox.has("tries/records.jsonl") ? lines_of(sandbox.text("tries/records.jsonl")).size()
                                              : 0;
  };
  for (int i = 0; i < 4000 && recorded() < 2; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  ::kill(child, SIGKILL);
  CHECK(sandbox.finish(child).exit_code == -SIGKILL);
  const std::string text = sandbox.text("tries/records.jsonl");
  REQUIRE(text.size() > 100);
  sandbox.put("tries/records.jsonl", text.substr(0, text.size() - 50));
  const std::size_t before = lines_of(text).size() - 1;
  const auto again = sandbox.run({"sweep", "run", "tries"});
  CHECK(again.exit_code == 0);
  CHECK_THAT(again.err,
             Catch::Contains("tries/records.jsonl: the last line was cut; its run is repeated"));
  CHECK(again.out == "tries: " + std::to_string(6 - before) + " runs recorded now, " +
                         std::to_string(before) + " before, 0 left\n");
  const auto resumed = reproducible_records(sandbox, "tries/records.jsonl");
  CHECK(sandbox.run({"sweep", "run", "tries", "--fresh", "--jobs", "1"}).exit_code == 0);
  CHECK(reproducible_records(sandbox, "tries/records.jsonl") == resumed);
}

TEST_CASE("Ctrl-C also ends the child processes of a sweep, with exit code 130", "[end_to_end]") {
  Sandbox sandbox;
  // With a tiny gain the arm neither arrives nor stalls, so that each run takes long.
  plan(sandbox, {"--duration", "100000", "--set", "/stall=null", "--set",
                 "/planner/params/k_p=1e-6", "--set", "/step_s=0.001"});
  // The plan creates this file, and the run creates it again when it begins.
  std::filesystem::remove(sandbox.path("tries/records.jsonl"));
  const pid_t child = sandbox.start({"sweep", "run", "tries", "--jobs", "2"});
  for (int i = 0; i < 2000 && !sandbox.has("tries/records.jsonl"); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  ::kill(child, SIGINT);
  const auto output = sandbox.finish(child);
  CHECK(output.exit_code == 130);
  CHECK(output.out == "tries: 0 runs recorded now, 0 before, 2 left\n");
  CHECK(sandbox.text("tries/records.jsonl").empty());
}

TEST_CASE("sweep plan, run and merge refuse unusable input with one line", "[end_to_end]") {
  Sandbox sandbox;
  const auto refused = [&](const std::vector<std::string>& arguments, const std::string& reason) {
    const auto output = sandbox.run(arguments);
    CAPTURE(arguments, output.err);
    CHECK(output.exit_code == 2);
    CHECK(lines_of(output.err).size() == 1);
    CHECK_THAT(output.err, Catch::Contains(reason));
  };
  refused({"sweep", "plan", "-o", "x"}, "nothing to plan");
  refused({"sweep", "plan", "data/scenes/shelf.json", "--planner", "hybrid:no_such=1", "-o", "x"},
          "no_such");
  refused({"sweep", "plan", "data/scenes/shelf.json", "--planner", "no_such", "-o", "x"},
          "no_such");
  CHECK_FALSE(sandbox.has("x/plan.json"));
  refused({"sweep", "run", "nowhere"}, "nowhere: is not a directory");
  refused({"sweep", "merge", "nowhere"}, "nowhere: is not a directory");
  plan(sandbox);
  refused({"sweep", "run", "tries", "--only", "no_such"}, "no run id contains 'no_such'");
  refused({"sweep", "merge", "tries", "-o", "tries/plan.json"}, "tries/plan.json: is an input");
  refused({"sweep", "merge", "tries", "--page", "/no/such/page.html"}, "/no/such/page.html");
  refused({"sweep", "merge", "tries", "--by", "colour"}, "--by colour: no run has that label");
  REQUIRE(sandbox.run({"sweep", "run", "tries", "--limit", "1"}).exit_code == 0);
  refused({"sweep", "plan", "data/scenes/paper_52_gyro.json", "-o", "tries"},
          "holds records of another plan");
  sandbox.put("tries/plan.json", "{\"schema\": \"hamelin.sweep/1\", \"scenes\": [], \"runs\": [");
  refused({"sweep", "run", "tries"}, "tries/plan.json: line 1");
}

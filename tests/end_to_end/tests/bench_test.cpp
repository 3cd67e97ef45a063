// The benchmark: its problems, runs of planners with them, tables and results.
#include "../program.hpp"
#include "hamelin/core/isa.hpp"

using namespace hamelin;
using test::lines_of;
using test::Sandbox;

namespace {

using Strings = std::vector<std::string>;

// The line of a table that begins with this word.
std::string line_of(const std::string& text, const std::string& word) {
  for (const auto& line : lines_of(text))
    if (line.starts_with(word + " ")) return line;
  return "no line";
}

}  // namespace

TEST_CASE("the problems of the benchmark have the same bytes with every instruction set",
          "[end_to_end]") {
  Sandbox sandbox;
  const Json made = test::run_json(sandbox, {"bench", "make", "-o", "problems"});
  CHECK(made["problems"] == 100);
  CHECK(sandbox.files().size() == 102);  // with `data` and `problems`
  const Json set = sandbox.json("data/bench/v1.json");
  for (const auto& problem : set["problems"])
    CHECK(sha256_of_file(sandbox.path("problems/" + problem["name"].get<std::string>() +
                                      ".json")) == problem["sha256"]);
  // The program itself checks problems and maps against the hashes of the set.
  for (const Isa isa : {Isa::baseline, Isa::v3, Isa::v4}) {
    if (!is_available(isa)) continue;
    const test::EnvironmentVariable variable("HAMELIN_ISA", std::string(name_of(isa)));
    const std::string folder = "with_" + std::string(name_of(isa));
    const auto output = sandbox.run({"bench", "run", "--per-family", "1", "--planner", "template",
                                     "--duration", "0.01", "-o", folder});
    CAPTURE(folder, output.err);
    CHECK(output.exit_code == 0);
    CHECK(sandbox.text(folder + "/problems/cage-01.json") == sandbox.text("problems/cage-01.json"));
  }
}

TEST_CASE("planners run with the benchmark, and its results fit their schema", "[end_to_end]") {
  Sandbox sandbox;
  const Strings command{"bench",      "run",       "--family", "shelf,pillars", "--per-family",
                        "2",          "--planner", "gyro",     "--planner",     "template",
                        "--duration", "2",         "-o",       "results"};
  const auto output = sandbox.run(command);
  CAPTURE(output.err);
  REQUIRE(output.exit_code == 0);
  CHECK_THAT(line_of(output.out, "family"), Catch::EndsWith("gyro  template"));
  CHECK_THAT(line_of(output.out, "pillars"), Catch::EndsWith("/2"));
  CHECK_THAT(line_of(output.out, "template"), Catch::Contains("/4"));
  CHECK_THAT(lines_of(output.out).back(),
             Catch::StartsWith("results/benchmark.json: hamelin-bench-1, 4 of 100 problems, "
                               "SHA-256 "));
  const auto checked = sandbox.run({"validate", "results/benchmark.json", "data/bench/v1.json",
                                    "results/plan.json", "results/records.jsonl"});
  CAPTURE(checked.err);
  CHECK(checked.exit_code == 0);
  const Json results = sandbox.json("results/benchmark.json");
  CHECK(results["problems"] == Json{"shelf-01", "shelf-02", "pillars-01", "pillars-02"});
  CHECK(results["planners"] == Json{"gyro", "template"});
  CHECK(results["summary"]["groups"].size() == 4);
  for (const auto& group : results["summary"]["groups"]) {
    CHECK(group["runs"] == 2);
    CHECK(group["feasible"] == 2);
  }
  CHECK(results["machine"]["isa"].is_string());
  // a second call runs nothing again, and prints the same
  const std::string records = sandbox.text("results/records.jsonl");
  const auto again = sandbox.run(command);
  CHECK(again.exit_code == 0);
  CHECK(again.out == output.out);
  CHECK(sandbox.text("results/records.jsonl") == records);
  CHECK(sandbox.run({"bench", "table", "results"}).out == output.out);
  CHECK_THAT(sandbox.run({"bench", "table", "results", "--markdown"}).out,
             Catch::StartsWith("| family | gyro | template |\n"
                               "| --- | --: | --: |\n| shelf | "));
}

TEST_CASE("planners are compared with themselves without a part", "[end_to_end]") {
  Sandbox sandbox;
  const Strings command{"bench",         "run",
                        "--family",      "shelf,pillars",
                        "--per-family",  "1",
                        "--planner",     "hybrid",
                        "--planner",     "hybrid:escape=none",
                        "--ablate",      "repulsion_speed_m_s",
                        "--duration",    "3",
                        "--expect-gain", "-o",
                        "parts"};
  const auto output = sandbox.run(command);
  CAPTURE(output.err);
  REQUIRE(output.exit_code == 0);
  CHECK_THAT(line_of(output.out, "family"),
             Catch::EndsWith("hybrid  hybrid:repulsion_speed_m_s=0  hybrid:escape=none  "
                             "hybrid:escape=none,repulsion_speed_m_s=0"));
  CHECK_THAT(line_of(output.out, "ablation"), Catch::Contains("only with  only without"));
  CHECK_THAT(line_of(output.out, "hybrid:escape=none,repulsion_speed_m_s=0"),
             Catch::Contains("/2"));
  const auto checked = sandbox.run({"validate", "parts/benchmark.json", "parts/plan.json"});
  CAPTURE(checked.err);
  CHECK(checked.exit_code == 0);
  const Json results = sandbox.json("parts/benchmark.json");
  CHECK(results["planners"].size() == 4);
  REQUIRE(results["ablations"].size() == 2);
  CHECK(results["ablations"][0]["planner"] == "hybrid");
  CHECK(results["ablations"][1]["without"] == "hybrid:escape=none,repulsion_speed_m_s=0");
  for (const auto& ablation : results["ablations"]) {
    CHECK(ablation["value"] == 0);
    CHECK(ablation["pairs"] == 2);
    CHECK(ablation["left_out"] == 0);
  }
  // the directory stores what was ablated, and only those runs have the part switched off
  CHECK(sandbox.run({"bench", "table", "parts"}).out == output.out);
  const Json plan = sandbox.json("parts/plan.json");
  for (const auto& run : plan["runs"]) {
    const bool ablated = run["labels"]["planner"].get<std::string>().ends_with("=0");
    const bool set =
        run["set"].dump().find("/planner/params/repulsion_speed_m_s=0") != std::string::npos;
    CHECK(set == ablated);
  }
  CHECK_THAT(sandbox.run({"sweep", "compare", "parts"}).out,
             Catch::Contains("hybrid against hybrid:repulsion_speed_m_s=0: 2 pairs"));
  test::require_pages();
  CHECK(sandbox.run({"sweep", "merge", "parts", "--page", "page.html"}).exit_code == 0);
  CHECK(sandbox.has("page.html"));
}

TEST_CASE("problems with moving obstacles are scenes that run", "[end_to_end]") {
  Sandbox sandbox;
  const Json made = test::run_json(sandbox, {"bench", "make", "--problems", "moving", "--family",
                                             "people", "--per-cell", "1", "-o", "scenes"});
  CHECK(made["set"] == "hamelin-moving-1");
  CHECK(made["problems"] == 6);
  const std::string scene = "scenes/people-1-025-01.json";
  CHECK(sandbox.run({"validate", scene}).exit_code == 0);
  const auto run =
      sandbox.run({"run", scene, "--set", "/duration_s=0.05", "--result", "result.json"});
  CAPTURE(run.err);
  CHECK(run.exit_code == 1);
  CHECK(sandbox.json("result.json")["outcome"] == "timeout");
}

TEST_CASE("planners run with moving obstacles, as drawn and with another prediction",
          "[end_to_end]") {
  Sandbox sandbox;
  const Strings command{"bench",        "run",    "--problems",   "moving",
                        "--per-family", "1",      "--family",     "people,pendulums",
                        "--planner",    "hybrid", "--planner",    "template",
                        "--prediction", "drawn",  "--prediction", "speed-bound",
                        "--duration",   "1",      "-o",           "results"};
  const auto output = sandbox.run(command);
  CAPTURE(output.err);
  REQUIRE(output.exit_code == 0);
  CHECK_THAT(line_of(output.out, "family"),
             Catch::Contains("hybrid  template  hybrid, speed-bound  template, speed-bound"));
  CHECK_THAT(line_of(output.out, "pendulums"), Catch::Contains("/1"));
  CHECK_THAT(line_of(output.out, "contacts of"), Catch::Contains("arm at rest"));
  const auto checked = sandbox.run({"validate", "results/benchmark.json", "data/bench/moving.json",
                                    "results/plan.json", "results/records.jsonl"});
  CAPTURE(checked.err);
  CHECK(checked.exit_code == 0);
  const Json results = sandbox.json("results/benchmark.json");
  CHECK(results["set"]["name"] == "hamelin-moving-1");
  CHECK(results["problems"] == Json{"people-1-025-01", "pendulums-2-030-01"});
  CHECK(results["planners"].size() == 4);
  CHECK(results["contacts"].size() == 4);
  CHECK(results["summary"]["groups"].size() == 8);
  CHECK(sandbox.run({"bench", "table", "--problems", "moving", "results"}).out == output.out);
}

TEST_CASE("contacts with moving obstacles are counted and explained", "[end_to_end]") {
  Sandbox sandbox;
  // Without a shield the template drives into the first pendulum.
  Strings command{
      "bench",     "run",       "--problems", "moving", "--per-family",      "1",  "--family",
      "pendulums", "--planner", "template",   "--set",  "/safety/type=none", "-o", "results"};
  const auto counted = sandbox.run(command);
  CAPTURE(counted.err);
  REQUIRE(counted.exit_code == 0);
  const Json before = sandbox.json("results/benchmark.json")["contacts"][0];
  CHECK(before["arm_moves"] == 1);
  CHECK(before["arm_at_rest"] == 0);
  CHECK(before["avoidable"] == 0);
  CHECK_FALSE(sandbox.has("results/contacts"));
  command.emplace_back("--explain");
  const auto explained = sandbox.run(command);
  CAPTURE(explained.err);
  REQUIRE(explained.exit_code == 0);
  CHECK(sandbox.json("results/benchmark.json")["contacts"][0]["avoidable"] == 1);
  CHECK(sandbox.run({"validate", "results/benchmark.json"}).exit_code == 0);
  CHECK(sandbox.run({"bench", "table", "--problems", "moving", "results"}).out == explained.out);
  CHECK(explained.out != counted.out);
}

TEST_CASE("wrong command lines and changed sets of the benchmark end with one line",
          "[end_to_end]") {
  Sandbox sandbox;
  std::string text = sandbox.text("data/bench/v1.json");
  const auto seed = text.find("\"seed\":1");
  REQUIRE(seed != std::string::npos);
  text.replace(seed, 8, "\"seed\":2");
  for (const char* file : {"robots/arm7.urdf", "robots/arm7.spheres.json"})
    sandbox.put(file, sandbox.text("data/" + std::string(file)));
  sandbox.put("bench/changed.json", text);
  struct Wrong {
    Strings arguments;
    std::string message;
  };
  const std::vector<Wrong> all{
      {{"bench"}, "a command is missing"},
      {{"bench", "make"}, "--output"},
      {{"bench", "make", "-o", "out", "--family", "shlef"}, "'shelf'?"},
      {{"bench", "make", "-o", "out", "--per-family", "0"}, "--per-family"},
      {{"bench", "make", "-o", "out", "--problems", "absent.json"}, "absent.json"},
      {{"bench", "make", "-o", "out", "--problems", "data/scenes/shelf.json"},
       "data/scenes/shelf.json: "},
      {{"bench", "make", "-o", "out", "--problems", "bench/changed.json"},
       "bench/changed.json: problem 'shelf-01': this build makes it with SHA-256"},
      {{"bench", "run", "-o", "out", "--problems", "bench/changed.json"},
       "bench/changed.json: problem 'shelf-01'"},
      {{"bench", "run", "-o", "out", "--planner", "absent", "--per-family", "1", "--family",
        "shelf"},
       "absent"},
      {{"bench", "run", "-o", "out", "--goal", "jonit"}, "'joint'?"},
      {{"bench", "run", "-o", "out", "--per-family", "1", "--family", "shelf", "--ablate",
        "stering_gain"},
       "--ablate stering_gain: planner 'hybrid' has no parameter 'stering_gain', expected one of "},
      {{"bench", "run", "-o", "out", "--per-family", "1", "--family", "shelf", "--ablate",
        "cruise_speed"},
       "expected cruise_speed=VALUE or one of "},
      {{"bench", "run", "-o", "out", "--per-family", "1", "--family", "shelf", "--planner",
        "hybrid", "--planner", "template", "--ablate", "steering"},
       "planner 'template' has no parameter 'steering'"},
      {{"bench", "run", "-o", "out", "--expect-gain"}, "--expect-gain: has no effect"},
      {{"bench", "run", "-o", "out", "--prediction", "path"}, "--prediction: has no effect"},
      {{"bench", "run", "-o", "out", "--explain"}, "--explain: has no effect"},
      {{"bench", "run", "-o", "out", "--problems", "moving", "--goal", "pose"},
       "--goal: has no effect"},
      {{"bench", "run", "-o", "out", "--problems", "moving", "--family", "shelf"},
       "expected one of cubes, people, pendulums"},
      {{"bench", "make", "-o", "out", "--problems", "moved"}, "bench/moved.json"},
      {{"bench", "table", "data"}, "data/plan.json"},
      {{"bench", "draw", "-o", "set.json", "--name", "x", "--robot", "absent.urdf"},
       "absent.urdf"}};
  for (const auto& wrong : all) {
    CAPTURE(wrong.arguments);
    const auto output = sandbox.run(wrong.arguments);
    CAPTURE(output.err);
    CHECK(output.exit_code == 2);
    CHECK(lines_of(output.err).size() == 1);
    CHECK_THAT(output.err, Catch::Contains(wrong.message));
    CHECK_FALSE(sandbox.has("set.json"));
  }
}

TEST_CASE("a set is drawn again with the same bytes, and its problems are solved by their paths",
          "[end_to_end]") {
  Sandbox sandbox;
  const Strings command{"bench",        "draw",
                        "--name",       "small",
                        "--family",     "pillars",
                        "--per-family", "1",
                        "--robot",      "data/robots/arm7.urdf",
                        "--spheres",    "data/robots/arm7.spheres.json",
                        "--tip",        "flange",
                        "--draw-seed",  "3",
                        "-o",           "one.json"};
  const auto output = sandbox.run(command);
  CAPTURE(output.err);
  REQUIRE(output.exit_code == 0);
  Strings again = command;
  again.back() = "two.json";
  CHECK(sandbox.run(again).exit_code == 0);
  CHECK(sandbox.text("one.json") == sandbox.text("two.json"));
  CHECK(sandbox.run({"validate", "one.json"}).out == "one.json: ok (problem set, 1 problems)\n");
  CHECK(sandbox
            .run({"bench", "run", "--problems", "one.json", "--planner", "template", "--duration",
                  "0.01", "-o", "tries"})
            .exit_code == 0);
}

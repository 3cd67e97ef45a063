#include <fmt/format.h>
#include <signal.h>

#include <chrono>
#include <cmath>
#include <thread>

#include "../program.hpp"

using namespace hamelin;
using test::Sandbox;

namespace {

Json run_scene(Sandbox& sandbox, const std::string& name, int exit_code,
               std::vector<std::string> more = {}) {
  more.insert(more.begin(), {"run", "data/scenes/" + name + ".json"});
  return test::run_json(sandbox, more, exit_code);
}

Json without_timing(Json line) {
  line.erase("timing");
  line.erase("provenance");
  return line;
}

}  // namespace

TEST_CASE("in example 5.2 apf stalls, and gyro and hybrid reach the goal without contact",
          "[end_to_end]") {
  Sandbox sandbox;
  const Json apf = run_scene(sandbox, "paper_52_apf", 1);
  CHECK(apf["outcome"] == "stalled");
  CHECK(apf["cause"].is_string());
  CHECK(apf["goal"]["error_m"].get<double>() > 0.2);
  for (const char* name : {"paper_52_gyro", "paper_52_hybrid"}) {
    CAPTURE(name);
    const Json result = run_scene(sandbox, name, 0);
    CHECK(result["outcome"] == "reached");
    CHECK(result["min_clearance_m"].get<double>() > 0.0);
    CHECK(result["goal"]["error_m"].get<double>() <= 0.02);
  }
}

TEST_CASE("the arm moves in MuJoCo where the build has it, and one line says so where not",
          "[end_to_end]") {
  Sandbox sandbox;
  const std::vector<std::string> arguments{"--plant", "mujoco"};
#ifdef HAMELIN_WITH_MUJOCO
  const Json result = run_scene(sandbox, "clutter", 0, arguments);
  CHECK(result["outcome"] == "reached");
  CHECK(result["integrator"] == "mujoco-euler");
  CHECK(result["plant"]["type"] == "mujoco");
  CHECK(result["plant"]["contacts"] == 0);
  CHECK(result["plant"]["judge_contacts"] == 0);
  CHECK_FALSE(std::filesystem::exists(sandbox.path("MUJOCO_LOG.TXT")));
  const auto described = sandbox.run(
      {"run", "data/scenes/paper_52_hybrid.json", "--plant", "mujoco", "--print-config"});
  CHECK(described.exit_code == 0);
  CHECK(described.err ==
        "hamelin: note: data/scenes/paper_52_hybrid.json: /actuation/type: is sampled instead of "
        "ideal, because the joints of MuJoCo take torques\n");
  const auto refused = sandbox.run(
      {"run", "data/scenes/clutter.json", "--plant", "mujoco", "--set", "/actuation/type=ideal"});
  CHECK(refused.exit_code == 2);
  CHECK_THAT(refused.err, Catch::Contains("/actuation/type: is ideal, expected sampled"));
#else
  std::vector<std::string> command{"run", "data/scenes/clutter.json"};
  command.insert(command.end(), arguments.begin(), arguments.end());
  const auto missing = sandbox.run(command);
  CHECK(missing.exit_code == 2);
  CHECK_THAT(
      missing.err,
      Catch::EndsWith("hamelin: data/scenes/clutter.json: /plant/type: is mujoco, which this "
                      "build of hamelin is without, expected hamelin; to build with MuJoCo, "
                      "install libmujoco-dev and configure again\n"));
#endif
  const Json own = run_scene(sandbox, "clutter", 0, {"--plant", "hamelin"});
  CHECK(own["integrator"] == "hamel-variational");
  CHECK_FALSE(own.contains("plant"));
}

TEST_CASE("a target is streamed from a file or standard input", "[end_to_end]") {
  Sandbox sandbox;
  std::string lines;
  for (int i = 0; i <= 50; ++i)
    lines += fmt::format("{{\"time_s\": {:.2f}, \"velocity_m_s\": [0, 0.1, 0]}}\n", 0.02 * i);
  write_file_atomically(sandbox.path("stick.jsonl"), lines + "wrong\n");
  Json scene = read_json(std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/scenes/follow.json");
  scene["goals"] = {{{"type", "follow"}}};
  for (const char* key : {"file", "spheres"})
    scene["robot"][key] = (std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/scenes" /
                           scene["robot"][key].get<std::string>())
                              .lexically_normal()
                              .string();
  write_file_atomically(sandbox.path("stick.json"), scene.dump());
  const std::vector<std::string> command{"run",        "stick.json", "--target", "stick.jsonl",
                                         "--duration", "3",          "--log",    "stick.log.jsonl"};
  const Json result = test::run_json(sandbox, command);
  CHECK(result["outcome"] == "followed");
  CHECK(result["following"]["refused_lines"] == 1);
  CHECK(result["warnings"][0].get<std::string>().find("stick.jsonl: line 52: ") !=
        std::string::npos);
  CHECK(result["following"]["all"]["rms_m"].get<double>() < 0.003);
  CHECK(sandbox.run({"replay", "stick.log.jsonl", "--verify"}).exit_code == 0);
  CHECK(sandbox.run({"validate", "stick.log.jsonl"}).exit_code == 0);
  const auto without = sandbox.run({"run", "stick.json"});
  CHECK(without.exit_code == 2);
  CHECK(without.err.find("/goals/0/stream/file: is missing") != std::string::npos);
}

TEST_CASE("energy-neutral steering does no work at any step size", "[end_to_end]") {
  Sandbox sandbox;
  for (const char* scene : {"paper_52_gyro", "paper_52_hybrid"})
    for (const char* step : {"0.001", "0.004", "0.01"}) {
      CAPTURE(scene, step);
      const Json result = run_scene(sandbox, scene, 0, {"--step", step});
      CHECK(std::abs(result["gyroscopic_work_J"].get<double>()) <= 1e-10);
    }
}

TEST_CASE("the arm reaches its goals in shelf and clutter, with every step proved clear",
          "[end_to_end]") {
  Sandbox sandbox;
  for (const char* name : {"shelf", "clutter"}) {
    CAPTURE(name);
    const Json result = run_scene(sandbox, name, 0);
    CHECK(result["outcome"] == "reached");
    CHECK(result["min_clearance_m"].get<double>() > 0.0);
    CHECK(result["certified_share"] == 1.0);
    CHECK(result["goal"]["index"] == result["goal"]["count"]);  // all goals were reached
    CHECK(result["filter_work_J"].get<double>() <= 1e-9);
  }
}

TEST_CASE("results and logs fit their schemas, and a seed determines all but timing and provenance",
          "[end_to_end]") {
  Sandbox sandbox;
  for (const std::string n : {"1", "2"}) {
    const auto output = sandbox.run({"run", "data/scenes/clutter.json", "--seed", "5", "--every",
                                     "50", "--log", n + ".jsonl", "--result", n + ".json"});
    REQUIRE(output.exit_code == 0);
    CHECK_THAT(output.out, Catch::Contains("outcome     reached"));
    const auto checked = sandbox.run({"validate", n + ".jsonl", n + ".json"});
    CAPTURE(checked.err);
    CHECK(checked.exit_code == 0);
  }
  CHECK(without_timing(sandbox.json("1.json")).dump() ==
        without_timing(sandbox.json("2.json")).dump());
  const auto first = test::lines_of(sandbox.text("1.jsonl")),
             second = test::lines_of(sandbox.text("2.jsonl"));
  REQUIRE(first.size() == second.size());
  CHECK(first.size() > 20);
  std::size_t different = 0;
  for (std::size_t i = 0; i < first.size(); ++i)
    different += without_timing(parse_json(first[i], "log")).dump() !=
                 without_timing(parse_json(second[i], "log")).dump();
  CHECK(different == 0);
  CHECK(parse_json(first.front(), "log")["type"] == "header");
  CHECK(parse_json(first.back(), "log")["type"] == "result");
}

TEST_CASE("a long run is interrupted by SIGINT and still closes its log and result",
          "[end_to_end]") {
  Sandbox sandbox;
  const pid_t child =
      sandbox.start({"integrate", "data/robots/planar3.json", "--step", "0.0001", "--duration",
                     "100000", "--every", "100", "--log", "run.jsonl", "--result", "run.json"});
  // The signal handler is installed before the log gets its first line.
  for (int i = 0; i < 2000 && !(sandbox.has("run.jsonl") && !sandbox.text("run.jsonl").empty());
       ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  ::kill(child, SIGINT);
  const auto output = sandbox.finish(child);
  CHECK(output.exit_code == 130);
  CHECK(sandbox.json("run.json")["outcome"] == "interrupted");
  const Json last = parse_json(test::lines_of(sandbox.text("run.jsonl")).back(), "log");
  CHECK(last["type"] == "result");
  CHECK(last["outcome"] == "interrupted");
  CHECK(sandbox.run({"validate", "run.jsonl", "run.json"}).exit_code == 0);
}

TEST_CASE("a start in contact is refused, with the result written", "[end_to_end]") {
  Sandbox sandbox;
  const auto output = sandbox.run({"run", "data/scenes/paper_52_hybrid.json", "--set",
                                   "/obstacles/0/position_m=[0.5,0,0]", "--result", "r.json"});
  CHECK(output.exit_code == 2);
  const auto lines = test::lines_of(output.err);
  REQUIRE(lines.size() == 3);  // after two notes on what is modelled
  CHECK_THAT(lines[0] + lines[1], Catch::Contains("no gravity") && Catch::Contains("payload none"));
  CHECK_THAT(lines[2], Catch::StartsWith("hamelin: data/scenes/paper_52_hybrid.json: refused: ") &&
                           Catch::Contains("link1") && Catch::Contains("obstacle"));
  CHECK(sandbox.json("r.json")["outcome"] == "refused");
  CHECK(sandbox.json("r.json")["steps"] == 0);
  CHECK(sandbox.run({"validate", "r.json"}).exit_code == 0);
}

TEST_CASE(
    "plugins list names the installed planners, and refused plugins do not change its exit code",
    "[end_to_end]") {
  Sandbox sandbox;
  sandbox.put("planners/broken.hamelin.so", "this is no library\n");
  const auto output = sandbox.run({"plugins", "list", "--plugin-path", "planners"});
  CHECK(output.exit_code == 0);
  for (const char* name : {"apf", "gyro", "hybrid", "template", "broken.hamelin.so"}) {
    CAPTURE(name);
    CHECK_THAT(output.out + output.err, Catch::Contains(name));
  }
  CHECK(test::run_json(sandbox, {"plugins", "list"}).is_structured());
}

TEST_CASE("an arm that is at its goal but does not rest times out, and the cause says so",
          "[end_to_end]") {
  Sandbox sandbox;
  const Json result = test::run_json(
      sandbox,
      {"run", "data/scenes/pillar.json", "--set", "/obstacles=[]", "--planner", "template", "--set",
       "/planner/params/damping=5", "--set", "/goals/0/speed_max=1e-9", "--duration", "6"},
      1);
  CHECK(result["outcome"] == "timeout");
  CHECK_THAT(result["cause"].get<std::string>(),
             Catch::Contains("within the tolerances, but its fastest joint moves at") &&
                 Catch::Contains("expected less than 1e-09 (speed_max)"));
}

TEST_CASE("the scene that --print-config prints runs to the same result", "[end_to_end]") {
  Sandbox sandbox;
  for (const char* command : {"run", "integrate"}) {
    CAPTURE(command);
    const auto printed = sandbox.run({command, "data/scenes/paper_52_gyro.json", "--step", "0.002",
                                      "--duration", "3", "--print-config"});
    REQUIRE(printed.exit_code == 0);
    CHECK(parse_json(printed.out, "standard output")["integrator"]["params"]["tolerance"] == 1e-12);
    sandbox.put("printed.json", printed.out);
    Json given = test::run_json(
        sandbox, {command, "data/scenes/paper_52_gyro.json", "--step", "0.002", "--duration", "3"},
        command == std::string("run") ? 1 : 0);
    Json again =
        test::run_json(sandbox, {command, "printed.json"}, command == std::string("run") ? 1 : 0);
    for (Json* result : {&given, &again})
      for (const char* key : {"scene", "timing", "provenance"}) result->erase(key);
    CHECK(given == again);
  }
}

#include <cmath>

#include "../program.hpp"
#include "hamelin/test/scene_data.hpp"

using namespace hamelin;
using test::Sandbox;
namespace fs = std::filesystem;

namespace {

// A ball of voxels at the third joint of planar4, which is stretched along x at the start.
Json scene_in_a_ball(Sandbox& sandbox) {
  sandbox.put("ball.primitives.json", R"({"schema": "hamelin.primitives/1", "resolution_m": 0.02,
    "free_bounds_m": {"min_m": [-4.6, -4.6, -0.5], "max_m": [4.6, 4.6, 0.5]},
    "obstacles": [{"type": "sphere", "radius_m": 0.1, "position_m": [2, 0, 0]}]})");
  REQUIRE(sandbox.run({"scene", "make", "--primitives", "ball.primitives.json", "-o", "ball.bt"})
              .exit_code == 0);
  Json scene = sandbox.json("data/scenes/paper_52_apf.json");
  scene["robot"]["file"] = "data/robots/planar4.json";
  scene["obstacles"] = Json::array();
  scene["map"] = {{"file", "ball.bt"}};
  scene["start"] = {{"q", {0.0, 0.0, 0.0, 0.0}}};
  scene["duration_s"] = 0.1;
  return scene;
}

bool some(const Json& lines, const std::string& text) {
  return std::any_of(lines.begin(), lines.end(), [&](const Json& line) {
    return line.get<std::string>().find(text) != std::string::npos;
  });
}

}  // namespace

TEST_CASE("scene info of a map reports the occupancy within reach of a base", "[end_to_end]") {
  Sandbox sandbox;
  const std::string map = "data/maps/clutter.bt";
  const Json all = test::run_json(sandbox, {"scene", "info", map});
  CHECK(all["kind"] == "map");
  CHECK(all["bytes"] == fs::file_size(sandbox.path(map)));
  CHECK(all["sha256"] == sha256_hex(sandbox.text(map)));
  CHECK(all["resolution_m"] == 0.02);
  CHECK(all["within_reach"]["occupied_leaves"] == all["occupied_leaves"]);
  const Json near =
      test::run_json(sandbox, {"scene", "info", map, "--base", "0,0,0.3", "--reach", "0.6"});
  const Json& within = near["within_reach"];
  CHECK(within["base_m"] == Json{0.0, 0.0, 0.3});
  CHECK(within["reach_m"] == 0.6);
  CHECK(within["occupied_leaves"] < all["occupied_leaves"]);
  CHECK(within["boxes"] <= within["occupied_leaves"]);
  CHECK(within["boxes"] > 0);
  CHECK(within["structure_bytes"] > 0);
  CHECK(within["occupied_share"].get<double>() + within["free_share"].get<double>() +
            within["unknown_share"].get<double>() ==
        Approx(1.0));
  CHECK(within["occupied_share"] > 0.0);
  // Only "timing" depends on the clock.
  Json again =
      test::run_json(sandbox, {"scene", "info", map, "--base", "0,0,0.3", "--reach", "0.6"});
  Json once = near;
  CHECK(once["timing"]["build_ms"] > 0.0);
  again.erase("timing");
  once.erase("timing");
  CHECK(again == once);

  const auto text = sandbox.run({"scene", "info", map, "--base", "0,0,0.3", "--reach", "0.6"});
  CHECK(text.exit_code == 0);
  CHECK_THAT(text.out, Catch::StartsWith("data/maps/clutter.bt: OctoMap with voxels of 0.02 m"));
  CHECK_THAT(text.out, Catch::Contains("within reach  0.6 m of 0 0 0.3: "));

  for (const std::vector<std::string>& wrong : {std::vector<std::string>{"--threshold", "1"},
                                                {"--threshold", "0"},
                                                {"--reach", "0"},
                                                {"--base", "1,2"},
                                                {"--scale", "-1"}}) {
    std::vector<std::string> command{"scene", "info", map};
    command.insert(command.end(), wrong.begin(), wrong.end());
    CAPTURE(command);
    const auto output = sandbox.run(command);
    CHECK(output.exit_code == 2);
    CHECK(output.out.empty());
    CHECK(test::lines_of(output.err).size() == 1);
  }
  const auto scene = sandbox.run({"scene", "info", "data/scenes/shelf.json", "--reach", "1"});
  CHECK(scene.exit_code == 2);
  CHECK_THAT(scene.err, Catch::Contains("a scene has its own"));
}

TEST_CASE("scene info of a scene prints readable text, or all data as JSON", "[end_to_end]") {
  Sandbox sandbox;
  const Json info = test::run_json(sandbox, {"scene", "info", "data/scenes/shelf.json"});
  const Json& within = info["map"]["within_reach"];
  CHECK(within["reach_m"] == info["reach_m"]);
  CHECK(within["boxes"] > 0);
  CHECK(within["structure_bytes"] > 0);
  CHECK(info["map"]["self_filter"].is_null());
  CHECK(info["map"]["sha256"] == sha256_hex(sandbox.text("data/maps/shelf.bt")));
  const auto text = sandbox.run({"scene", "info", "data/scenes/shelf.json"});
  CHECK_THAT(text.out, Catch::StartsWith("data/scenes/shelf.json: scene of "));
  for (const char* line : {"\n  goals ", "\n  planner ", "\n  map ", "\n  within reach ",
                           "\n  structure ", "\n  clearance "})
    CHECK_THAT(text.out, Catch::Contains(line));
}

TEST_CASE("for its scene a cropped map is equivalent to the full map", "[end_to_end]") {
  Sandbox sandbox;
  const auto output = sandbox.run({"scene", "crop", "--scene", "data/scenes/clutter.json",
                                   "--influence", "0.2", "-o", "near.bt"});
  CAPTURE(output.err);
  REQUIRE(output.exit_code == 0);
  CHECK_THAT(output.out, Catch::StartsWith("near.bt: "));
  Json scene = sandbox.json("data/scenes/clutter.json");
  for (const char* key : {"file", "spheres"})
    if (scene["robot"].contains(key))
      scene["robot"][key] = "data/scenes/" + scene["robot"][key].get<std::string>();
  scene["map"]["file"] = "near.bt";
  sandbox.put("near.json", scene.dump());
  const Json whole = test::run_json(sandbox, {"scene", "info", "data/scenes/clutter.json"}),
             cropped = test::run_json(sandbox, {"scene", "info", "near.json"});
  CHECK(cropped["map"]["within_reach"]["occupied_leaves"] ==
        whole["map"]["within_reach"]["occupied_leaves"]);
  CHECK(cropped["map"]["within_reach"]["boxes"] == whole["map"]["within_reach"]["boxes"]);
  CHECK(cropped["map"]["within_reach"]["occupied_share"] ==
        whole["map"]["within_reach"]["occupied_share"]);
  CHECK(cropped["map"]["within_reach"]["unknown_share"] ==
        whole["map"]["within_reach"]["unknown_share"]);
  CHECK(cropped["clearance_at_start_m"] == whole["clearance_at_start_m"]);

  const Json made = test::run_json(sandbox, {"scene", "crop", "data/maps/clutter.bt", "--center",
                                             "0,0,0.3", "--radius", "0.4", "-o", "ball.bt"});
  CHECK(made["bytes"] == fs::file_size(sandbox.path("ball.bt")));
  CHECK(made["bytes"] < made["bytes_before"]);
  CHECK(made["sha256"] == sha256_hex(sandbox.text("ball.bt")));
  CHECK(sandbox
            .run({"scene", "crop", "data/maps/clutter.bt", "--box", "0,-0.5,0,0.5,0.5,1", "-o",
                  "box.bt"})
            .exit_code == 0);
  CHECK(sandbox.run({"validate", "ball.bt", "box.bt", "near.bt"}).exit_code == 0);
}

TEST_CASE("scene crop refuses bad options with one line, and writes no file", "[end_to_end]") {
  Sandbox sandbox;
  sandbox.put("own.bt", sandbox.text("data/maps/clutter.bt"));
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases{
      {{"own.bt", "--center", "0,0,0", "--radius", "1", "-o", "own.bt"}, "is the map itself"},
      {{"own.bt", "--center", "0,0,0", "--radius", "1", "-o", "made.ot"}, "ends in .bt"},
      {{"own.bt", "--center", "90,0,0", "--radius", "1", "-o", "made.bt"}, "nothing of the map"},
      {{"own.bt", "--center", "0,0,0", "-o", "made.bt"}, "belong together"},
      {{"own.bt", "-o", "made.bt"}, "expected one of"},
      {{"own.bt", "--center", "0,0,0", "--radius", "1", "--box", "0,0,0,1,1,1", "-o", "made.bt"},
       "expected one of"},
      {{"own.bt", "--box", "0,0,0,1,1", "-o", "made.bt"}, "--box"},
      {{"own.bt", "--center", "0,0,0", "--radius", "1", "--threshold", "2", "-o", "made.bt"},
       "threshold"},
      {{"own.bt", "--center", "0,0,0", "--radius", "1", "--unknown", "block", "-o", "made.bt"},
       "keep, free"},
      {{"--center", "0,0,0", "--radius", "1", "-o", "made.bt"}, "no map"},
      {{"absent.bt", "--center", "0,0,0", "--radius", "1", "-o", "made.bt"}, "absent.bt"},
      {{"--scene", "data/scenes/paper_52_apf.json", "-o", "made.bt"}, "/map: is missing"}};
  for (const auto& [arguments, expected] : cases) {
    std::vector<std::string> command{"scene", "crop"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    CAPTURE(command);
    const auto output = sandbox.run(command);
    CAPTURE(output.err);
    CHECK(output.exit_code == 2);
    CHECK(output.out.empty());
    CHECK(test::lines_of(output.err).size() == 1);
    CHECK(output.err.find(expected) != std::string::npos);
    CHECK_FALSE(fs::exists(sandbox.path("made.bt")));
  }
  CHECK((sandbox.text("own.bt") == sandbox.text("data/maps/clutter.bt")));
}

TEST_CASE("a map that contains the robot gives a warning, and a self-filter removes the robot",
          "[end_to_end]") {
  Sandbox sandbox;
  Json scene = scene_in_a_ball(sandbox);
  sandbox.put("scene.json", scene.dump());
  const Json plain = test::run_json(sandbox, {"scene", "info", "scene.json"});
  CHECK(some(plain["warnings"], "the map may contain the robot itself"));
  CHECK(plain["clearance_at_start_m"] < 0.0);
  const auto refused =
      sandbox.run({"run", "scene.json", "--planner", "apf", "--result", "refused.json"});
  CHECK(refused.exit_code == 2);
  CHECK(sandbox.json("refused.json")["outcome"] == "refused");
  CHECK(some(sandbox.json("refused.json")["warnings"], "map.self_filter"));

  scene["map"]["self_filter"] = {{"padding_m", 0.03}};
  sandbox.put("scene.json", scene.dump());
  const Json filtered = test::run_json(sandbox, {"scene", "info", "scene.json"});
  const Json& filter = filtered["map"]["self_filter"];
  CHECK(filter["padding_m"] == 0.03);
  CHECK(filter["occupied_voxels"] > 50);
  CHECK(filter["occupied_leaves"] > 0);
  CHECK(filtered["clearance_at_start_m"] >= 0.03);
  CHECK_FALSE(some(filtered["warnings"], "may contain the robot"));
  CHECK_THAT(sandbox.run({"scene", "info", "scene.json"}).out, Catch::Contains("\n  self-filter "));
  const auto run = sandbox.run({"run", "scene.json", "--planner", "apf", "--result", "run.json"});
  CAPTURE(run.err);
  CHECK(run.exit_code < 2);
  CHECK(some(sandbox.json("run.json")["warnings"],
             "the self-filter removed " + filter["occupied_voxels"].dump()));
}

TEST_CASE("a map without free space is refused if unknown space is an obstacle", "[end_to_end]") {
  Sandbox sandbox;
  Json scene = scene_in_a_ball(sandbox);
  sandbox.put("bare.primitives.json", R"({"schema": "hamelin.primitives/1", "resolution_m": 0.02,
    "obstacles": [{"type": "sphere", "radius_m": 0.1, "position_m": [2, 2, 0]}]})");
  REQUIRE(sandbox.run({"scene", "make", "--primitives", "bare.primitives.json", "-o", "bare.bt"})
              .exit_code == 0);
  scene["map"] = {{"file", "bare.bt"}, {"unknown", "block"}};
  sandbox.put("scene.json", scene.dump());
  const auto refused = sandbox.run({"run", "scene.json", "--planner", "apf", "--result", "r.json"});
  CHECK(refused.exit_code == 2);
  CHECK_THAT(refused.err, Catch::Contains("bare.bt: the map has no free leaf"));
  scene["map"]["unknown"] = "slow";
  sandbox.put("scene.json", scene.dump());
  CHECK(some(test::run_json(sandbox, {"scene", "info", "scene.json"})["warnings"],
             "slows all motion down"));
}

TEST_CASE("a scene made from a problem has known space all around its arm", "[end_to_end]") {
  const fs::path problem_file =
      fs::path(HAMELIN_SOURCE_DIR) / "libs/scene/tests/data/cabinet.problem.json";
  const fs::path& robots = test::third_party_robots;
  Sandbox sandbox;
  for (const char* mark : {"touch", "centre"}) {
    const auto output = sandbox.run(
        {"scene", "make", problem_file.string(), "--robot", (robots / "panda.urdf").string(),
         "--spheres", (robots / "panda_spheres.json").string(), "--tip", "panda_grasptarget",
         "--resolution", "0.01", "--mark", mark, "-o", "scene.json"});
    CAPTURE(output.err);
    REQUIRE(output.exit_code == 0);
    const Json info = test::run_json(sandbox, {"scene", "info", "scene.json"});
    CHECK(info["map"]["within_reach"]["unknown_share"] == 0.0);
    CHECK(info["map"]["within_reach"]["occupied_share"] > 0.0);
    CHECK_FALSE(some(info["warnings"], "free leaf"));
    CHECK(info["obstacles"] == sandbox.json("scene.json")["obstacles"].size());
  }
  Json problem = read_json(problem_file);
  problem["obstacles"][2]["type"] = "mesh";
  sandbox.put("problem.json", problem.dump());
  const auto refused =
      sandbox.run({"scene", "make", "problem.json", "--robot", (robots / "panda.urdf").string(),
                   "--tip", "panda_grasptarget", "-o", "none.json"});
  CHECK(refused.exit_code == 2);
  CHECK_THAT(refused.err, Catch::Contains("problem.json: /obstacles/2/type: is \"mesh\""));
  CHECK_FALSE(fs::exists(sandbox.path("none.bt")));
}

TEST_CASE("a scene with few keys falls under gravity within all limits, and the program says so",
          "[end_to_end]") {
  Sandbox sandbox;
  Json scene{{"schema", "hamelin.scene/1"},
             {"robot", {{"file", "data/robots/arm6.urdf"}}},
             {"start", {{"q", {0.0, 0.3, 0.5, 0.0, 0.0, 0.0}}}},
             {"goals", {{{"type", "joint"}, {"q", {0.1, 0.35, 0.55, 0.0, 0.0, 0.0}}}}},
             {"planner", {{"name", "hybrid"}}}};
  sandbox.put("few.json", scene.dump());
  const std::string all =
      "gravity (0, 0, -9.81) m/s^2; limits: joint on, velocity on, torque on; self-collision off";
  const auto info = sandbox.run({"scene", "info", "few.json"});
  CHECK_THAT(info.out, Catch::Contains(all) && Catch::Contains("payload none; damping off"));
  const auto run = sandbox.run({"run", "few.json"});
  CAPTURE(run.err);
  CHECK(run.exit_code == 0);
  CHECK(test::lines_of(run.err).at(0) == "hamelin: note: few.json: " + all);
  CHECK(sandbox.run({"--quiet", "run", "few.json"}).err.empty());
  const Json fall = test::run_json(sandbox, {"integrate", "few.json", "--duration", "0.2"});
  CHECK(std::abs(fall["v"][1].get<double>()) > 0.5);

  const std::vector<std::string> off{
      "--set", "/gravity_m_s2=null",           "--set", "/model/joint_limits=false",
      "--set", "/model/velocity_limits=false", "--set", "/model/torque_limits=false"};
  std::vector<std::string> command{"run", "few.json"};
  command.insert(command.end(), off.begin(), off.end());
  CHECK_THAT(sandbox.run(command).err,
             Catch::Contains("few.json: no gravity; limits: joint off, velocity off, torque off"));
  command.push_back("--print-config");
  const Json config = test::run_json(sandbox, command);
  CHECK(config["gravity_m_s2"] == Json({0.0, 0.0, 0.0}));
  for (const char* key : {"joint_limits", "velocity_limits", "torque_limits"})
    CHECK(config["model"][key] == false);

  scene["start"]["q"][4] = 1.4;
  sandbox.put("beyond.json", scene.dump());
  const auto beyond = sandbox.run({"run", "beyond.json", "--log", "log.jsonl"});
  CHECK(beyond.exit_code == 2);
  CHECK(beyond.out.empty());
  CHECK(beyond.err ==
        "hamelin: beyond.json: /start/q: joint 'joint5' is at 1.4, beyond its limit, expected "
        "at most 1.3 (\"joint_limits\": false under /model switches the limits off)\n");
  CHECK_THAT(test::run_json(sandbox, {"scene", "info", "beyond.json"})["warnings"].dump(),
             Catch::Contains("is at 1.4, beyond its limit"));
}

TEST_CASE("a log of a weightless scene without limits replays as it ran", "[end_to_end]") {
  // Logs of versions whose scenes had neither gravity nor limits by default state both: null is no
  // gravity.
  Sandbox sandbox;
  REQUIRE(
      sandbox
          .run({"run", "data/scenes/paper_52_gyro.json", "--duration", "0.2", "--log", "log.jsonl"})
          .exit_code == 1);
  std::string text = sandbox.text("log.jsonl");
  const std::string now = "\"gravity_m_s2\":[0.0,0.0,0.0]";
  const auto at = text.find(now);
  REQUIRE(at != std::string::npos);
  text.replace(at, now.size(), "\"gravity_m_s2\":null");
  sandbox.put("old.jsonl", text);
  const auto replay = sandbox.run({"replay", "old.jsonl", "--verify"});
  CAPTURE(replay.out, replay.err);
  CHECK(replay.exit_code == 0);
}

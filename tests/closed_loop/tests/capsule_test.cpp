#include <spdlog/logger.h>
#include <spdlog/sinks/ostream_sink.h>
#include <algorithm>

#include <catch2/catch.hpp>
#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "../scratch_scene.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/test/chains.hpp"

using namespace hamelin;
using log::Outcome;
using test::ball;
using test::run_scene;
using test::scene_52;
using test::TemporaryFolder;

namespace {

/// Example 5.2's arm with one capsule per link in place of a row of spheres.
model::Robot capsule_arm() {
  model::Robot robot = test::planar4();
  for (auto& link : robot.links) {
    const double radius = link.spheres.at(0).radius_m;
    link.segments = {{link.spheres.front().center_m, link.spheres.back().center_m, radius}};
    link.spheres.clear();
  }
  return robot;
}

}  // namespace

TEST_CASE(
    "with every planner an arm of capsules arrives where one of spheres does, without contact",
    "[simulation][capsule]") {
  const TemporaryFolder folder;
  for (const std::string planner : {"apf", "gyro", "hybrid"}) {
    CAPTURE(planner);
    Json scene = read_json(std::filesystem::path(HAMELIN_SOURCE_DIR) / "data" / "scenes" /
                           ("paper_52_" + planner + ".json"));
    scene["robot"] = {{"file", "robot.json"}};
    const auto spheres = run_scene(folder, scene);
    const auto capsules = run_scene(folder, scene, {}, capsule_arm());
    CAPTURE(spheres.cause, capsules.cause);
    CHECK((capsules.outcome == Outcome::reached) == (spheres.outcome == Outcome::reached));
    REQUIRE(capsules.min_clearance_m.has_value());
    CHECK(*capsules.min_clearance_m > 0.0);
    CHECK(capsules.certified_share == 1.0);
  }
}

TEST_CASE(
    "a capsule at an obstacle is named with link, depth and exit direction, at start and goals",
    "[simulation][capsule]") {
  const TemporaryFolder folder;
  Json scene = scene_52();
  // The arm lies along x. Its second link's capsule has a radius of 20 mm.
  scene["start"] = {{"q", {0.0, 0.0, 0.0, 0.0}}};
  scene["obstacles"] = Json::array({ball("post", 1.5, 0.11, 0.1)});
  const auto refused = run_scene(folder, scene, {}, capsule_arm());
  CHECK(refused.outcome == Outcome::refused);
  CHECK(refused.cause ==
        "capsule 0 of link 'link2' is 10 mm inside obstacle 'post' at 0 s; the exit direction is "
        "(0, -1, 0)");

  scene["start"] = {{"q", {0.3, 0.0, 0.0, 0.0}}};
  scene["goals"] = {{{"type", "joint"}, {"q", {0.0, 0.0, 0.0, 0.0}}},
                    {{"type", "position"}, {"position_m", {1.5, 0.17, 0.0}}},
                    {{"type", "position"}, {"position_m", {2.0, 3.0, 0.0}}}};
  scene["duration_s"] = 0.04;
  std::ostringstream output;
  simulation::Watch watch;
  watch.diagnostics = std::make_shared<spdlog::logger>(
      "test", std::make_shared<spdlog::sinks::ostream_sink_st>(output));
  watch.diagnostics->set_pattern("%l: %v");
  const auto result = run_scene(folder, scene, watch, capsule_arm());
  const std::vector<std::string> expected{
      "goal 1: capsule 0 of link 'link2' is 10 mm inside obstacle 'post'; the exit direction is "
      "(0, -1, 0)",
      "goal 2: its tip is 40 mm inside obstacle 'post'; the exit direction is (0, 1, 0)"};
  const std::string begin = "info: " + (folder.path() / "scene.json").string() + ": ";
  const std::string modelled = begin +
                               "no gravity; limits: joint off, velocity off, torque off; "
                               "self-collision off\n" +
                               begin + "payload none; damping off; friction off\n";
  CHECK(output.str() == modelled + "info: " + expected[0] + "\ninfo: " + expected[1] + "\n");
  CHECK(result.warnings == expected);

  // A moving obstacle may be elsewhere when the arm arrives.
  scene["obstacles"][0]["motion"] = {
      {"type", "sine"}, {"amplitude_m", {0.0, 0.5, 0.0}}, {"period_s", 5.0}};
  output.str("");
  (void)run_scene(folder, scene, watch, capsule_arm());
  CHECK(output.str() == modelled);
}

TEST_CASE("the log's closest shape is counted link by link, spheres before capsules",
          "[simulation][capsule]") {
  const TemporaryFolder folder;
  Json scene = scene_52();
  scene["start"] = {{"q", {0.0, 0.0, 0.0, 0.0}}};
  scene["obstacles"] = Json::array({ball("post", 1.5, 0.2, 0.1)});
  scene["duration_s"] = 0.004;
  model::Robot robot = capsule_arm();
  robot.links[0].spheres = {{{-0.4, 0.0, 0.0}, 0.01}, {{-0.3, 0.0, 0.0}, 0.01}};
  log::RunLog file(folder.path() / "run.jsonl");
  simulation::Watch watch;
  watch.log = &file;
  (void)run_scene(folder, scene, watch, robot);
  const auto lines = log::read_log(folder.path() / "run.jsonl").lines;
  bool seen = false;
  for (const Json& line : lines)
    if (line["type"] == "tick" && line["k"] == 0) {
      seen = true;
      // two spheres and a capsule of link1, then link2's capsule
      CHECK(line["closest"]["sphere"] == 3);
      CHECK(line["clearance_m"] == Approx(0.2 - 0.1 - 0.02));
    }
  CHECK(seen);
}

TEST_CASE("an arm of capsules is kept clear of itself", "[simulation][capsule]") {
  const TemporaryFolder folder;
  model::Robot robot = capsule_arm();
  robot.self_collision_disabled.clear();
  Json scene = scene_52();
  const double corner = M_PI / 2.0;
  scene["start"] = {{"q", {0.0, corner, corner, corner - 0.3}}};  // nearly a square
  scene["goals"] = {{{"type", "joint"}, {"q", {0.0, corner, corner, corner + 0.1}}}};
  scene["model"]["self_collision"] = true;
  scene["safety"] = {{"type", "certificate"}};  // a shield would stop the arm
  const auto free = run_scene(folder, scene, {}, robot);
  CHECK(free.outcome == Outcome::collision);
  CHECK_THAT(free.cause, Catch::Contains("'link1' and 'link4'"));
  CHECK(std::any_of(free.warnings.begin(), free.warnings.end(), [](const std::string& line) {
    return line.find("goal 1: the arm touches itself: 'link1' and 'link4'") == 0;
  }));
  scene["planner"] = {{"name", "hybrid"}, {"params", Json::object()}};
  scene["duration_s"] = 3.0;
  const auto held = run_scene(folder, scene, {}, robot);
  CAPTURE(held.cause);
  CHECK(held.outcome != Outcome::collision);  // the goal's tolerance allows a clear pose
  CHECK(*held.min_self_clearance_m > 0.0);
  CHECK(held.certified_share == 1.0);
}

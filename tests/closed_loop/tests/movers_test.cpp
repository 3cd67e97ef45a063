// Robots of data/robots among moving obstacles, with planner hybrid.
#include <fmt/format.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "../scratch_scene.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/test/allocations.hpp"

using namespace hamelin;
using log::Outcome;
using test::TemporaryFolder;

namespace {

const std::filesystem::path robots = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/robots";

/// The seven-joint arm turns about its base, from one side to the other.
Json turning_arm() {
  return {{"schema", "hamelin.scene/1"},
          {"robot",
           {{"file", (robots / "arm7.urdf").string()},
            {"tip", "flange"},
            {"spheres", (robots / "arm7.spheres.json").string()}}},
          {"start", {{"q", {-0.9, -0.3, 0.0, -2.0, 0.0, 1.7, 0.0}}}},
          {"goals",
           {{{"type", "joint"}, {"q", {0.9, -0.3, 0.0, -2.0, 0.0, 1.7, 0.0}}},
            {{"type", "joint"}, {"q", {-0.9, -0.3, 0.0, -2.0, 0.0, 1.7, 0.0}}},
            {{"type", "joint"}, {"q", {0.9, -0.3, 0.0, -2.0, 0.0, 1.7, 0.0}}}}},
          {"model", {{"joint_limits", true}, {"velocity_limits", true}, {"torque_limits", true}}},
          {"planner", {{"name", "hybrid"}}},
          {"step_s", 0.002},
          {"duration_s", 20.0}};
}

Json swinging_sphere() {
  return Json::array(
      {{{"name", "pendulum"},
        {"type", "sphere"},
        {"radius_m", 0.15},
        {"position_m", {0.5, 0.0, 0.6}},
        {"motion", {{"type", "sine"}, {"amplitude_m", {0.0, 0.6, 0.0}}, {"period_s", 2.5}}}}});
}

Json turning_box() {
  Json waypoints = Json::array();
  for (int i = 0; i <= 4; ++i) {
    const double half = 0.25 * std::acos(-1.0) * i;
    waypoints.push_back({{"time_s", 0.5 * i},
                         {"position_m", {0.45, 0.0, 0.5}},
                         {"quaternion_wxyz", {std::cos(half), 0.0, 0.0, std::sin(half)}}});
  }
  waypoints[4]["quaternion_wxyz"] = {1.0, 0.0, 0.0, 0.0};
  return Json::array(
      {{{"name", "turnstile"},
        {"type", "box"},
        {"size_m", {0.5, 0.06, 0.3}},
        {"motion", {{"type", "waypoints"}, {"repeat", true}, {"waypoints", waypoints}}},
        {"prediction", "path"}}});
}

Json walking_capsules() {
  return Json::array(
      {{{"name", "person"},
        {"type", "frame"},
        {"position_m", {0.75, 0.0, 0.0}},
        {"motion", {{"type", "sine"}, {"amplitude_m", {0.2, 0.5, 0.0}}, {"period_s", 2.0}}}},
       {{"name", "trunk"},
        {"type", "capsule"},
        {"radius_m", 0.12},
        {"length_m", 0.8},
        {"attached_to", "person"},
        {"position_m", {0.0, 0.0, 0.5}}},
       {{"name", "arm"},
        {"type", "capsule"},
        {"radius_m", 0.05},
        {"length_m", 0.3},
        {"attached_to", "person"},
        {"position_m", {-0.2, 0.0, 0.7}},
        {"quaternion_wxyz", {std::sqrt(0.5), 0.0, std::sqrt(0.5), 0.0}}}});
}

struct MoversRun {
  log::Result result;
  std::vector<std::string> ticks;  ///< lines of the log without timings
  std::vector<double> evading_s;   ///< times of ticks in which the arm evaded
  double first_event_s = 1e9;      ///< time of the planner's first message
};

MoversRun logged_run(const Json& document) {
  const TemporaryFolder folder;
  log::RunLog log(folder.path() / "run.jsonl");
  simulation::Watch watch;
  watch.log = &log;
  MoversRun run;
  run.result = test::run_scene(folder, document, watch);
  for (auto& line : log::read_log(log.file()).lines) {
    if (line["type"] == "event")
      run.first_event_s = std::min(run.first_event_s, line["time_s"].get<double>());
    if (line["type"] != "tick") continue;
    line.erase("timing");
    if (line.contains("series"))
      if (const Json& act = line["series"][0]; act.is_number() && act != 0.0)
        run.evading_s.push_back(line["time_s"].get<double>());
    run.ticks.push_back(line.dump());
  }
  return run;
}

std::map<std::string, Json> all_movers() {
  return {{"swinging sphere", swinging_sphere()},
          {"turning box", turning_box()},
          {"walking capsules", walking_capsules()}};
}

Json scene_with(const Json& obstacles) {
  Json document = turning_arm();
  document["obstacles"] = obstacles;
  return document;
}

}  // namespace

TEST_CASE("hybrid reaches its goals among obstacles that move, without contact",
          "[hybrid][closed_loop][movers]") {
  for (const auto& [name, obstacles] : all_movers()) {
    CAPTURE(name);
    const MoversRun run = logged_run(scene_with(obstacles));
    CHECK(run.result.outcome == Outcome::reached);
    REQUIRE(run.result.min_clearance_m);
    CHECK(*run.result.min_clearance_m > 0.0);
    CHECK(run.result.filter_work_J <= 1e-12);
    CHECK(run.result.recovery_work_J >= 0.0);
    CHECK(run.evading_s.size() > 100);

    // An arm that does not know of them is hit.
    Json hidden = obstacles;
    for (auto& obstacle : hidden)
      if (obstacle["type"] != "frame") obstacle["judge_only"] = true;
    const MoversRun blind = logged_run(scene_with(hidden));
    CHECK(blind.result.outcome == Outcome::collision);
    REQUIRE(blind.result.mover_contact);
    const auto& contact = *blind.result.mover_contact;
    CHECK(contact.time_s == blind.result.time_s);
    CHECK(contact.closing_speed_m_s > 0.0);
    CHECK(contact.closing_speed_m_s <= contact.arm_speed_m_s + contact.obstacle_speed_m_s + 1e-12);
    CHECK(contact.prediction == (name == "turning box" ? "path" : "constant-acceleration"));
    REQUIRE(!contact.prediction_errors.empty());
    for (const auto& error : contact.prediction_errors) CHECK(error.error_m >= 0.0);
  }
}

TEST_CASE("the arm in the shelf evades a person who reaches in", "[hybrid][closed_loop][movers]") {
  scene::Scene scene = scene::read_scene(robots.parent_path() / "scenes/shelf_person.json");
  const TemporaryFolder folder;
  // Which acts it takes depends on the seed and on rounding, as every run among moving obstacles
  // does.
  int evading = 0;  // milliseconds
  for (const std::uint64_t seed : {scene.seed, scene.seed - 1}) {
    scene.seed = seed;
    log::RunLog log(folder.path() / fmt::format("run{}.jsonl", seed));
    simulation::Watch watch;
    watch.log = &log;
    const log::Result result = simulation::run(scene, test::plugin_directories, watch);
    CHECK(result.outcome == Outcome::reached);
    REQUIRE(result.min_clearance_m);
    CHECK(*result.min_clearance_m > 0.005);
    for (const auto& line : log::read_log(log.file()).lines)
      if (line["type"] == "tick" && line.contains("series") &&
          line["series"][0].get<double>() > 0.0)
        ++evading;
  }
  CHECK(evading > 150);

  // The tip of the hand is 0.08 m from its centre, and is as fast as that of a person at work.
  const auto hand = std::find_if(scene.obstacles.begin(), scene.obstacles.end(),
                                 [](const auto& o) { return o.name == "hand"; });
  REQUIRE(hand != scene.obstacles.end());
  const auto tip = [&](double t) -> Eigen::Vector3d {
    return scene::motion_at(*hand, t).pose * Eigen::Vector3d(0.0, 0.0, 0.08);
  };
  double fastest = 0.0, deepest = 0.0;
  for (double t = 0.0; t < 12.0; t += 0.01) {
    fastest = std::max(fastest, (tip(t + 0.01) - tip(t)).norm() / 0.01);
    deepest = std::max(deepest, tip(t).x());
  }
  CHECK(fastest > 0.3);
  CHECK(fastest < 0.4);
  CHECK(deepest > 0.7);  // the shelf begins at 0.6 m

  // An arm that does not know of the person is hit.
  scene::Scene hidden = scene;
  for (auto& obstacle : hidden.obstacles) obstacle.known = false;
  const log::Result blind = simulation::run(hidden, test::plugin_directories, {});
  CHECK(blind.outcome == Outcome::collision);
  REQUIRE(blind.mover_contact);
  const std::string& obstacle = blind.mover_contact->obstacle;
  CHECK((obstacle == "hand" || obstacle == "forearm"));
}

TEST_CASE("runs among moving obstacles repeat, however the looks ahead are split",
          "[hybrid][closed_loop][movers]") {
  for (const auto& [name, obstacles] : all_movers()) {
    for (const int budget : {60, 200}) {
      CAPTURE(name, budget);
      const Json scene = scene_with(obstacles);
      const auto run = [&](int steps) {
        Json document = scene;
        document["planner"]["params"] = {{"look_budget", budget}, {"look_steps", steps}};
        document["duration_s"] = 5.0;
        return logged_run(document);
      };
      const MoversRun first = run(1);
      REQUIRE(first.ticks.size() > 1000);
      for (const int steps : {1, 7, 1000}) {
        CAPTURE(steps);
        const MoversRun again = run(steps);
        REQUIRE(again.ticks.size() == first.ticks.size());
        const auto [here, there] =
            std::mismatch(first.ticks.begin(), first.ticks.end(), again.ticks.begin());
        if (here != first.ticks.end()) FAIL(*here << "\nis now\n" << *there);
      }
    }
  }
}

TEST_CASE("the budget and the seed of looks ahead have an effect",
          "[hybrid][closed_loop][movers]") {
  const auto run = [&](const Json& params, int seed) {
    Json document = scene_with(swinging_sphere());
    document["planner"]["params"] = params;
    document["seed"] = seed;
    return logged_run(document).ticks;
  };
  const auto first = run(Json::object(), 1);
  CHECK(run({{"look_budget", 21}}, 1) != first);
  CHECK(run(Json::object(), 2) != first);
}

TEST_CASE("a tick does not allocate while the arm evades", "[simulation][allocation][movers]") {
  test::require_allocation_count();
  const TemporaryFolder folder;
  const auto plugin = planning::find_plugin("hybrid", test::plugin_directories);  // stays loaded
  for (const auto& [name, obstacles] : all_movers()) {
    CAPTURE(name);
    Json document = scene_with(obstacles);
    document["goals"][0]["speed_max"] = 1e-9;              // it stays there
    document["planner"]["params"] = {{"escape", "none"}};  // a search is announced
    document["duration_s"] = 5.0;
    const MoversRun logged = logged_run(document);
    REQUIRE(logged.evading_s.size() > 20);
    // The host allocates for messages of the planner.
    const double begin = logged.evading_s.front(), end = std::min(5.0, logged.first_event_s);
    REQUIRE(begin < logged.evading_s[20]);
    REQUIRE(logged.evading_s[20] < end);
    long before = -1, after = -1;
    simulation::Watch watch;
    watch.at_node = [&](double time_s, const auto&) {
      if (before < 0 && time_s >= begin) before = allocation_count();
      if (time_s < end) after = allocation_count();
    };
    CHECK(test::run_scene(folder, document, watch).outcome == Outcome::timeout);
    CHECK(before > 0);
    CHECK(after == before);
  }
}

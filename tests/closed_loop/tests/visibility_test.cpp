#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "../scratch_scene.hpp"
#include "hamelin/log/read_log.hpp"

using namespace hamelin;
using test::ball;
using test::run_scene;
using test::scene_52;
using test::TemporaryFolder;

namespace {

std::vector<std::string> events_of(const TemporaryFolder& folder, const Json& scene) {
  log::RunLog log(folder.path() / "run.jsonl");
  simulation::Watch watch;
  watch.log = &log;
  watch.every = 100;
  (void)run_scene(folder, scene, watch);
  std::vector<std::string> events;
  for (const auto& line : log::read_log(log.file()).lines)
    if (line["type"] == "event") events.push_back(line["text"]);
  return events;
}

bool has(const std::vector<std::string>& events, const std::string& text) {
  return std::find(events.begin(), events.end(), text) != events.end();
}

// The straight arm turns about its base by 2 rad in 2 s; a post stands at 0.5 rad, seen from 0.1 m on.
Json turning_past_a_post() {
  Json scene = scene_52();
  scene["obstacles"] = {ball("post", 4.25 * std::cos(0.5), 4.25 * std::sin(0.5), 0.2)};
  scene["obstacles"][0]["known"] = false;
  scene["obstacles"][0]["visible_within_m"] = 0.1;
  scene["planner"] = {{"name", "probe"}, {"params", {{"velocity", {1.0, 0.0, 0.0, 0.0}}, {"influence_m", 0.5}}}};
  scene["start"] = {{"v", {1.0, 0.0, 0.0, 0.0}}};
  scene["step_s"] = 0.004;
  scene["duration_s"] = 2.0;
  return scene;
}

}  // namespace

TEST_CASE("to think of a place does not show what is hidden there", "[simulation][visibility]") {
  const TemporaryFolder folder;
  Json scene = turning_past_a_post();
  scene["planner"]["params"]["think_of"] = {0.5, 0.0, 0.0, 0.0};  // right beside the post
  scene["duration_s"] = 0.2;                                      // the arm itself stays away
  const auto events = events_of(folder, scene);
  CHECK_FALSE(has(events, "obstacle 'post' comes into sight"));
  for (const auto& event : events) CHECK_THAT(event, !Catch::Contains("thought of"));

  scene["obstacles"][0]["known"] = true;
  const auto told = events_of(folder, scene);
  CHECK(std::any_of(told.begin(), told.end(), [](const auto& event) { return event.find("probe: thought of ") == 0; }));
}

TEST_CASE("what came into sight is remembered when the arm has passed", "[simulation][visibility]") {
  const TemporaryFolder folder;
  Json scene = turning_past_a_post();
  scene["planner"]["params"]["think_of"] = {0.5, 0.0, 0.0, 0.0};
  const auto events = events_of(folder, scene);
  REQUIRE(has(events, "obstacle 'post' comes into sight"));
  // once thought of, never forgotten
  std::vector<std::string> thoughts;
  for (const auto& event : events)
    if (event.find("thought of") != std::string::npos) thoughts.push_back(event);
  REQUIRE(thoughts.size() == 1);
  CHECK(thoughts[0] != "probe: thought of 0 contacts");
  // shown only while near, as everything is
  CHECK(std::count_if(events.begin(), events.end(),
                      [](const auto& event) { return event == "probe: shown 0 contacts"; }) == 1);
}

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

// The straight arm turns about its base by 2 rad in 2 s. A post at 0.5 rad is visible within 0.1 m.
Json turning_past_a_post() {
  Json scene = scene_52();
  scene["obstacles"] = Json::array({ball("post", 4.25 * std::cos(0.5), 4.25 * std::sin(0.5), 0.2)});
  scene["obstacles"][0]["known"] = false;
  scene["obstacles"][0]["visible_within_m"] = 0.1;
  scene["planner"] = {{"name", "probe"},
                      {"params", {{"velocity", {1.0, 0.0, 0.0, 0.0}}, {"influence_m", 0.5}}}};
  scene["start"] = {{"v", {1.0, 0.0, 0.0, 0.0}}};
  scene["step_s"] = 0.004;
  scene["duration_s"] = 2.0;
  return scene;
}

}  // namespace

TEST_CASE("a query about another configuration does not reveal hidden obstacles",
          "[simulation][visibility]") {
  const TemporaryFolder folder;
  Json scene = turning_past_a_post();
  scene["planner"]["params"]["think_of"] = {0.5, 0.0, 0.0, 0.0};  // right beside the post
  scene["duration_s"] = 0.2;                                      // the arm itself stays away
  const auto events = events_of(folder, scene);
  CHECK_FALSE(has(events, "obstacle 'post' becomes visible"));
  for (const auto& event : events) CHECK_THAT(event, !Catch::Contains("thought of"));

  scene["obstacles"][0]["known"] = true;
  const auto events_if_known = events_of(folder, scene);
  CHECK(std::any_of(events_if_known.begin(), events_if_known.end(),
                    [](const auto& event) { return event.find("probe: thought of ") == 0; }));
}

TEST_CASE("an obstacle that became visible is remembered when the arm has passed",
          "[simulation][visibility]") {
  const TemporaryFolder folder;
  Json scene = turning_past_a_post();
  scene["planner"]["params"]["think_of"] = {0.5, 0.0, 0.0, 0.0};
  const auto events = events_of(folder, scene);
  REQUIRE(has(events, "obstacle 'post' becomes visible"));
  // Queries show it once it is known, and always from then on.
  std::vector<std::string> query_events;
  for (const auto& event : events)
    if (event.find("thought of") != std::string::npos) query_events.push_back(event);
  REQUIRE(query_events.size() == 1);
  CHECK(query_events[0] != "probe: thought of 0 contacts");
  // Contacts of the tick include it only while it is near.
  CHECK(std::count_if(events.begin(), events.end(),
                      [](const auto& event) { return event == "probe: shown 0 contacts"; }) == 1);
}

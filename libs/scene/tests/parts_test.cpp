#include <catch2/catch.hpp>
#include <functional>
#include <string>

#include "hamelin/core/error.hpp"
#include "hamelin/scene/parts.hpp"

using namespace hamelin;
using Catch::Contains;

namespace {

std::string refusal(const std::function<void()>& read) {
  try {
    read();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("parts of a scene are read on their own", "[scene]") {
  const Json goal = {{"type", "joint"}, {"q", {0.1, 0.2}}};
  CHECK(scene::goals_from_json(goal, {}, "goals").size() == 1);
  const auto goals = scene::goals_from_json(Json::array({goal, goal}), {}, "goals");
  REQUIRE(goals.size() == 2);
  CHECK(goals[1].q[1] == 0.2);

  CHECK_FALSE(scene::map_from_json(nullptr, {}, "map"));
  const auto map = scene::map_from_json({{"file", "room.bt"}, {"scale", 2.0}}, "/maps", "map");
  REQUIRE(map);
  CHECK(map->file == "/maps/room.bt");

  const Json box = {{0, 0, 0, 1, 1, 1}};
  CHECK(scene::map_change_from_json({{"free_boxes_m", box}}, {}, "change").time_s == 0.0);
  CHECK(scene::map_change_from_json({{"free_boxes_m", box}, {"time_s", 2}}, {}, "c").time_s == 2.0);

  const Json ball = {
      {"type", "sphere"}, {"name", "ball"}, {"radius_m", 0.1}, {"position_m", {1, 2, 3}}};
  const scene::Obstacle obstacle = scene::obstacle_from_json(ball, {}, "obstacle");
  CHECK(obstacle.name == "ball");
  CHECK(obstacle.pose.p() == Eigen::Vector3d(1.0, 2.0, 3.0));
  CHECK(scene::payload_from_json({{"mass_kg", 0.5}}, "payload").mass_kg == 0.5);
}

TEST_CASE("parts of a scene that are not valid are refused with their place", "[scene]") {
  CHECK_THAT(refusal([] { (void)scene::goals_from_json(3, {}, "goals"); }),
             Contains("goals: /goals"));
  CHECK_THAT(refusal([] {
               (void)scene::goals_from_json({{"type", "no"}}, {}, "goals");
             }),
             Contains("goals: /goals/0"));
  CHECK_THAT(refusal([] {
               (void)scene::map_from_json({{"fil", "a"}}, {}, "map");
             }),
             Contains("map: /map"));
  CHECK_THAT(refusal([] {
               (void)scene::payload_from_json({{"mass_kg", -1}}, "payload");
             }),
             Contains("payload: /model/payload/mass_kg"));
  const std::string expected = ": has the type null, expected an object";
  CHECK(refusal([] { (void)scene::map_change_from_json(nullptr, {}, "change"); }) ==
        "change: /map/changes/0" + expected);
  CHECK(refusal([] { (void)scene::obstacle_from_json(nullptr, {}, "obstacle"); }) ==
        "obstacle: /obstacles/0" + expected);
  CHECK(refusal([] { (void)scene::payload_from_json(nullptr, "payload"); }) ==
        "payload: /model/payload" + expected);
}

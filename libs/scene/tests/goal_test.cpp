#include "hamelin/scene/goal.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "hamelin/scene/parts.hpp"
#include "hamelin/test/errors.hpp"

using namespace hamelin;
using Catch::Contains;
using Eigen::Vector3d;

namespace {

scene::Goal read(const char* text) {
  return scene::goals_from_json(parse_json(text, "goal"), {}, "goal").front();
}

std::string refused_goal(const char* text) {
  return test::error_of([&] { (void)read(text); });
}

}  // namespace

TEST_CASE("a goal may be any of several, with tolerances of their own", "[scene][goal]") {
  const scene::Goal goal = read(R"({"type": "any_of", "any_of": [
      {"type": "joint", "q": [1, 2]},
      {"type": "pose", "position_m": [1, 0, 0], "quaternion_wxyz": [1, 0, 0, 0],
       "tolerance_m": 0.003, "free_axis": [0, 0, 1], "low_m": [0, 0, -0.1], "high_m": [0, 0, 0]}],
    "constraints": [{"type": "axis", "angle_rad": 0.1}]})");
  CHECK(goal.type == scene::GoalType::any_of);
  REQUIRE(scene::options_of(goal).size() == 2);
  CHECK(goal.any_of[0].tolerance_rad == 0.05);
  CHECK(goal.any_of[1].tolerance_m == 0.003);
  CHECK(goal.any_of[1].free_axis == Vector3d::UnitZ());
  CHECK(goal.any_of[1].low_m == Vector3d(0, 0, -0.1));
  CHECK(goal.constraints.size() == 1);
  CHECK(scene::needs_path(goal));
  CHECK_FALSE(scene::needs_path(goal.any_of[0]));
  CHECK(scene::is_region(goal.any_of[1]));
  CHECK(scene::options_of(goal.any_of[0]).size() == 1);
}

TEST_CASE("goals of several options, ways and stretches read back as themselves", "[scene][goal]") {
  const Json given = parse_json(R"([
    {"type": "any_of", "retreat": {"distance_m": 0.1}, "any_of": [
      {"type": "joint", "q": [1, 2], "approach": {"distance_m": 0.05, "frame": "world"}},
      {"type": "pose", "position_m": [1, 0, 0], "quaternion_wxyz": [1, 0, 0, 0],
       "free_axis": [0, 1, 0], "low_m": [0, 0, -0.1], "high_m": [0, 0.2, 0]}]},
    {"type": "position", "position_m": [1, 0, 0], "way": {"type": "line"}},
    {"type": "pose", "position_m": [1, 0, 0], "quaternion_wxyz": [1, 0, 0, 0],
     "way": {"type": "arc", "through_m": [1, 1, 0], "tolerance_m": 0.004}}])",
                                "goals");
  scene::Scene scene;
  scene.goals = scene::goals_from_json(given, {}, "goals");
  const Json written = scene::resolved_json(scene)["goals"];
  scene::Scene again;
  again.goals = scene::goals_from_json(written, {}, "written");
  CHECK(scene::resolved_json(again)["goals"] == written);
  CHECK(written[0]["retreat"]["direction"] == Json({0.0, 0.0, -1.0}));
  CHECK(written[0]["any_of"][0]["approach"]["frame"] == "world");
  CHECK(written[2]["way"]["through_m"] == Json({1.0, 1.0, 0.0}));
  CHECK(again.goals[2].way->tolerance.m == 0.004);
  CHECK_FALSE(again.goals[1].way->through_m.has_value());
}

TEST_CASE("options, regions, ways and stretches that are wrong are refused with their place",
          "[scene][goal]") {
  CHECK_THAT(refused_goal(R"({"type": "any_of", "any_of": []})"), Contains("/goals/0/any_of"));
  CHECK_THAT(refused_goal(R"({"type": "any_of"})"), Contains("/goals/0/any_of: is missing"));
  CHECK_THAT(refused_goal(R"({"type": "any_of", "any_of": [{"type": "path", "q": [[1], [2]]}]})"),
             Contains("/goals/0/any_of/0/type: is path, expected joint, position or pose"));
  CHECK_THAT(refused_goal(R"({"type": "any_of", "any_of": [
      {"type": "joint", "q": [1], "constraints": []}]})"),
             Contains("/goals/0/any_of/0/constraints: is not allowed for a goal in any_of"));
  CHECK_THAT(refused_goal(R"({"type": "joint", "q": [1], "free_axis": [0, 0, 1]})"),
             Contains("/goals/0/free_axis: is not allowed for a joint goal"));
  CHECK_THAT(
      refused_goal(R"({"type": "pose", "position_m": [0, 0, 0], "quaternion_wxyz": [1, 0, 0, 0],
      "free_axis": [0, 0, 2]})"),
      Contains("/goals/0/free_axis: is not of length 1"));
  CHECK_THAT(refused_goal(R"({"type": "position", "position_m": [0, 0, 0], "low_m": [0, 1, 0]})"),
             Contains("/goals/0/low_m: is not below high_m"));
  CHECK_THAT(
      refused_goal(R"({"type": "position", "position_m": [0, 0, 0], "way": {"type": "arc"}})"),
      Contains("/goals/0/way/through_m: is missing"));
  CHECK_THAT(refused_goal(R"({"type": "position", "position_m": [0, 0, 0], "way": {"type": "line"},
      "retreat": {"distance_m": 0.1}})"),
             Contains("/goals/0/way: is given besides an approach or a retreat"));
  CHECK_THAT(refused_goal(R"({"type": "joint", "q": [1], "approach": {"distance_m": 0}})"),
             Contains("/goals/0/approach/distance_m"));
  CHECK_THAT(refused_goal(R"({"type": "joint", "q": [1], "approach": {"distance_m": 0.1,
      "direction": [0, 0, 0]}})"),
             Contains("/goals/0/approach/direction: is not of length 1"));
}

// A pose 0.1 away from a box, turned about an axis that is not free by 0.3 rad.
TEST_CASE("the nearest pose of a region is where it is left open", "[scene][goal]") {
  scene::Goal goal = scene::pose_goal(
      {Eigen::AngleAxisd(0.7, Vector3d::UnitX()).toRotationMatrix(), Vector3d(1, 2, 3)});
  goal.low_m = {-0.2, 0, 0};
  goal.high_m = {0, 0, 0.5};
  goal.free_axis = Vector3d::UnitY();
  const geometry::SE3 within(
      goal.pose.R() * Eigen::AngleAxisd(2.0, Vector3d::UnitY()).toRotationMatrix(),
      goal.pose.p() + goal.pose.R() * Vector3d(-0.1, 0, 0.3));
  const geometry::SE3 same = scene::nearest_pose(goal, within);
  CHECK((same.p() - within.p()).norm() < 1e-12);
  CHECK((same.R() - within.R()).norm() < 1e-12);

  const Vector3d across = within.R() * Vector3d::UnitX();
  const geometry::SE3 off(Eigen::AngleAxisd(0.3, across).toRotationMatrix() * within.R(),
                          goal.pose.p() + goal.pose.R() * Vector3d(-0.1, 0.1, 0.3));
  const geometry::SE3 nearest = scene::nearest_pose(goal, off);
  CHECK((nearest.p() - off.p()).norm() == Approx(0.1));
  CHECK(Eigen::AngleAxisd(nearest.R().transpose() * off.R()).angle() == Approx(0.3));
  CHECK(scene::nearest_pose(scene::pose_goal(within), off).p() == within.p());
}

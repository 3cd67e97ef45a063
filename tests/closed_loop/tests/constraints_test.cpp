// Goals on the way to which the tip keeps something: a tool that is carried upright in a shelf.
#include <catch2/catch.hpp>

#include "../scratch_scene.hpp"
#include "hamelin/test/errors.hpp"

using namespace hamelin;
using Catch::Contains;
using test::plugin_directories;

namespace {

const std::filesystem::path upright_folder =
    std::filesystem::path(HAMELIN_SOURCE_DIR) / "data" / "scenes";

Json upright(double angle_rad) {
  return Json::array({{{"type", "axis"},
                       {"axis", {-1, 0, 0}},
                       {"direction", {0, 0, 1}},
                       {"angle_rad", angle_rad}}});
}

// From one compartment of the shelf to others, after a first goal without constraints.
Json upright_shelf(const Json& constraints) {
  Json document = read_json(upright_folder / "shelf.json");
  const Json goals = document["goals"];
  document["goals"] = Json::array();
  for (const std::size_t i : {0U, 2U, 4U, 0U}) {
    Json goal = goals[i];
    goal["tolerance_rad"] = 0.04;
    goal["speed_max"] = 0.02;
    if (i != 0 || !document["goals"].empty()) goal["constraints"] = constraints;
    document["goals"].push_back(goal);
  }
  return document;
}

log::Result run_shelf(const Json& document) {
  return simulation::run(scene::scene_from_json(document, upright_folder, "shelf_upright.json"),
                         plugin_directories, {});
}

}  // namespace

TEST_CASE("a tool stays upright within five degrees on its way through a shelf",
          "[simulation][constraints]") {
  constexpr double five_degrees = 0.0873, wide = 1.5;
  Json document = upright_shelf(upright(five_degrees));
  const bool sampled = GENERATE(true, false);
  if (!sampled) document["actuation"] = {{"type", "ideal"}};
  const log::Result result = run_shelf(document);
  CHECK(result.outcome == log::Outcome::reached);
  CHECK(result.certified_share == 1.0);
  REQUIRE(result.constraints.size() == 3);
  for (const auto& kept : result.constraints) {
    CHECK(kept.type == "axis");
    CHECK(kept.excess <= 0.0);
  }
  // Where nearly any angle is allowed, the way is another.
  const log::Result free = run_shelf(upright_shelf(upright(wide)));
  CHECK(free.outcome == log::Outcome::reached);
  double largest = 0.0;
  for (const auto& kept : free.constraints) largest = std::max(largest, kept.excess + wide);
  CHECK(largest > 2.0 * five_degrees);
}

TEST_CASE("constraints that exclude the start or a goal are named where the arm waits",
          "[simulation][constraints]") {
  Json document = upright_shelf(upright(0.1));
  document["duration_s"] = 3.0;
  document["goals"][0]["constraints"] = upright(0.1);  // the arm points down at the start
  log::Result result = run_shelf(document);
  CHECK(result.outcome == log::Outcome::timeout);
  CHECK_THAT(result.cause,
             Contains("no path: where the arm is, constraint 1 (axis) is exceeded by"));
  document = upright_shelf(upright(0.1));
  document["goals"][1]["quaternion_wxyz"] = {1, 0, 0, 0};
  result = run_shelf(document);
  CHECK(result.outcome == log::Outcome::timeout);
  CHECK_THAT(result.cause, Contains("no path: at the goal, constraint 1 (axis) is exceeded by"));
}

TEST_CASE("planners that follow no paths are refused for goals with constraints",
          "[simulation][constraints]") {
  Json document = upright_shelf(upright(0.1));
  document["planner"] = {{"name", "apf"}};
  CHECK_THAT(test::error_of([&] { run_shelf(document); }),
             Contains("shelf_upright.json: /goals/1: constraints: planner 'apf' moves without"));
  document = upright_shelf({{{"type", "axis"}, {"angle_rad", 0.1}, {"low_m", {0, 0, 0}}}});
  CHECK_THAT(
      test::error_of([&] { run_shelf(document); }),
      Contains("/goals/1/constraints/0/low_m: is not allowed for a constraint of type axis"));
  document = upright_shelf({{{"type", "box"}, {"low_m", {0, 0, 1}}, {"high_m", {1, 1, 1}}}});
  CHECK_THAT(test::error_of([&] { run_shelf(document); }),
             Contains("/goals/1/constraints/0: low_m is not below high_m on each axis"));
}

TEST_CASE("a tip is no faster on its way than its goals allow", "[simulation][constraints]") {
  constexpr double slow = 0.25;
  Json document = upright_shelf({{{"type", "speed"}, {"speed_m_s", slow}}});
  const log::Result result = run_shelf(document);
  CHECK(result.outcome == log::Outcome::reached);
  REQUIRE(result.constraints.size() == 3);
  for (const auto& kept : result.constraints) {
    CHECK(kept.type == "speed");
    CHECK(kept.excess <= 0.0);
    CHECK(kept.excess > -0.15 * slow);  // it is used
  }
  document = upright_shelf({{{"type", "speed"}, {"speed_m_s", 100.0}}});
  const log::Result fast = run_shelf(document);
  CHECK(fast.time_s < 0.7 * result.time_s);
  CHECK(fast.constraints[0].excess + 100.0 > 3.0 * slow);
  document = upright_shelf({{{"type", "speed"}, {"speed_m_s", 0.1}, {"axis", {0, 0, 1}}}});
  CHECK_THAT(test::error_of([&] { run_shelf(document); }),
             Contains("/constraints/0/axis: is not allowed for a constraint of type speed"));
  document = upright_shelf({{{"type", "speed"}}});
  CHECK_THAT(test::error_of([&] { run_shelf(document); }),
             Contains("/constraints/0/speed_m_s: is missing"));
}

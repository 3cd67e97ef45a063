// Goals at which the arm may touch something: the can in the scene shelf_carry.
#include <catch2/catch.hpp>

#include "../scratch_scene.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/test/errors.hpp"

using namespace hamelin;
using Catch::Contains;
using test::plugin_directories;

namespace {

const std::filesystem::path carry_folder =
    std::filesystem::path(HAMELIN_SOURCE_DIR) / "data" / "scenes";
const Json of_can = {{"boxes_m", {{0.661, 0.341, 0.261, 0.779, 0.459, 0.439}}}};
constexpr double into_can_m = 0.04;

// The arm goes farther than to where it takes the can, and back.
Json into_can(const Json& first_may_touch, const Json& second_may_touch) {
  Json document = read_json(carry_folder / "shelf_carry.json");
  document.erase("events");
  document["goals"] = Json::array({document["goals"][0], document["goals"][2]});
  document["goals"][0]["position_m"][0] = 0.64 + into_can_m;
  document["goals"][0]["may_touch"] = first_may_touch;
  document["goals"][1]["may_touch"] = second_may_touch;
  document["duration_s"] = 20.0;
  return document;
}

scene::Scene touch_scene(const Json& document) {
  return scene::scene_from_json(document, carry_folder, "shelf_touch.json");
}

}  // namespace

TEST_CASE("an arm goes where it touches what a goal allows, and nowhere else",
          "[simulation][touch]") {
  const bool ideal = GENERATE(true, false);
  Json document = into_can(of_can, of_can);
  if (ideal) document["actuation"] = {{"type", "ideal"}};
  const log::Result result = simulation::run(touch_scene(document), plugin_directories, {});
  CHECK(result.outcome == log::Outcome::reached);
  CHECK(result.cause == "");
  CHECK(result.certified_share == 1.0);
  CHECK(result.min_clearance_m.value() > 0.0);
  REQUIRE(result.may_touch.size() == 2);
  CHECK(result.may_touch[0].goal == 1);
  CHECK(result.may_touch[0].what["boxes_m"] == of_can["boxes_m"]);
  CHECK(result.may_touch[0].clearance_m < 0.0);
  CHECK(log::to_json(result)["may_touch"][1]["goal"] == 2);
}

TEST_CASE("what no goal allows is in the way, and stays so for the next goal",
          "[simulation][touch]") {
  Json never = into_can(nullptr, nullptr);
  never["duration_s"] = 6.0;
  const log::Result kept_out = simulation::run(touch_scene(never), plugin_directories, {});
  CHECK(kept_out.outcome != log::Outcome::reached);
  CHECK(kept_out.min_clearance_m.value() > 0.0);
  CHECK(kept_out.may_touch.empty());

  const log::Result once =
      simulation::run(touch_scene(into_can(of_can, nullptr)), plugin_directories, {});
  CHECK(once.outcome == log::Outcome::collision);
  CHECK(once.goal->index == 1);
  CHECK_THAT(once.cause, Contains("inside the map"));
}

TEST_CASE("obstacles that a goal allows are no obstacles for it alone", "[simulation][touch]") {
  const Json may_touch = {{"obstacles", {"ball"}}};
  Json document = into_can(may_touch, may_touch);
  document.erase("map");
  document["obstacles"] = {
      {{"name", "ball"}, {"type", "sphere"}, {"radius_m", 0.05}, {"position_m", {0.72, 0.4, 0.38}}},
      {{"name", "other"},
       {"type", "sphere"},
       {"radius_m", 0.05},
       {"position_m", {0.72, 0.4, 0.6}}}};
  const log::Result result = simulation::run(touch_scene(document), plugin_directories, {});
  CHECK(result.outcome == log::Outcome::reached);
  CHECK(result.certified_share == 1.0);
  CHECK(result.min_clearance_m.value() > 0.0);
  REQUIRE(result.may_touch.size() == 2);
  CHECK(result.may_touch[0].clearance_m < 0.0);

  document["goals"][0]["may_touch"]["obstacles"] = {"bal"};
  CHECK_THAT(test::error_of([&] { touch_scene(document); }),
             Contains("shelf_touch.json: /goals/0/may_touch/obstacles: there is no obstacle 'bal', "
                      "expected one of the scene's 2; did you mean 'ball'?"));
}

TEST_CASE("a box of what may be touched without volume is refused", "[simulation][touch]") {
  const Json flat = {{"boxes_m", {{0.6, 0.3, 0.2, 0.6, 0.4, 0.4}}}};
  CHECK_THAT(test::error_of([&] { touch_scene(into_can(flat, nullptr)); }),
             Contains("/goals/0/may_touch/boxes_m/0: the low corner is not below"));
}

// Goals that are any of several, and ways of the tip: hybrid in the shelf.
#include <catch2/catch.hpp>

#include "../scratch_scene.hpp"
#include "hamelin/control/plan_paths.hpp"
#include "hamelin/test/errors.hpp"

using namespace hamelin;
using Catch::Contains;
using test::plugin_directories;

namespace {

const std::filesystem::path shelf_folder =
    std::filesystem::path(HAMELIN_SOURCE_DIR) / "data" / "scenes";

scene::Scene shelf_with(const Json& goals, double duration_s = 15.0) {
  Json document = read_json(shelf_folder / "shelf.json");
  document["goals"] = goals;
  document["duration_s"] = duration_s;
  return scene::scene_from_json(document, shelf_folder, "shelf_goals.json");
}

Json shelf_goal(std::size_t index) {
  return read_json(shelf_folder / "shelf.json")["goals"][index];
}

Json out_of_reach() {
  Json goal = shelf_goal(0);
  goal["position_m"] = {5.0, 0.0, 0.5};
  return goal;
}

// What the tip's rotation and its direction of motion are along the flange's z axis.
Json with_approach(Json goal, double distance_m) {
  goal["approach"] = {{"distance_m", distance_m}};
  return goal;
}

}  // namespace

TEST_CASE("an arm takes any of several places in a shelf, straight in and straight out",
          "[simulation][goals]") {
  const Json back{
      {"type", "joint"}, {"q", shelf_goal(1)["q"]}, {"retreat", {{"distance_m", 0.12}}}};
  const scene::Scene scene = shelf_with(
      {{{"type", "any_of"}, {"any_of", {out_of_reach(), with_approach(shelf_goal(0), 0.12)}}},
       back});
  const control::PathPlan plan = control::plan_paths(scene, {.motions = true});
  REQUIRE(plan.found());
  CHECK(plan.goals[0].path.goal == 1);
  CHECK(control::to_json(plan)["paths"][0]["any_of"]["taken"] == 1);
  CHECK_THAT(control::to_json(plan)["paths"][0]["any_of"]["options"][0]["cause"].get<std::string>(),
             Contains("no posture reaches it"));
  REQUIRE(plan.goals[0].motion);
  REQUIRE(plan.goals[1].motion);

  const log::Result result = simulation::run(scene, plugin_directories, {});
  CHECK(result.outcome == log::Outcome::reached);
  CHECK(result.certified_share == 1.0);
}

TEST_CASE("a tip moves along a line and an arc in a shelf", "[simulation][goals]") {
  Json up = shelf_goal(0), around = shelf_goal(0);
  up["position_m"] = {0.6, -0.25, 0.5};
  up["way"] = {{"type", "line"}};
  around["position_m"] = {0.58, -0.25, 0.42};
  around["way"] = {{"type", "arc"}, {"through_m", {0.56, -0.25, 0.46}}};
  Json first = shelf_goal(0);
  for (Json* goal : {&first, &up, &around}) {
    (*goal)["tolerance_rad"] = 0.03;
    (*goal)["speed_max"] = 0.05;  // a way begins where the arm rests
  }
  const log::Result result =
      simulation::run(shelf_with({first, up, around}), plugin_directories, {});
  CHECK(result.outcome == log::Outcome::reached);
  CHECK(result.certified_share == 1.0);
}

TEST_CASE("goals that no path reaches say why where the arm waits", "[simulation][goals]") {
  Json blocked = shelf_goal(0);
  blocked["position_m"] = {5.0, 0.0, 0.5};
  blocked["way"] = {{"type", "line"}};
  log::Result result =
      simulation::run(shelf_with(Json::array({blocked}), 1.0), plugin_directories, {});
  CHECK(result.outcome == log::Outcome::timeout);
  CHECK_THAT(result.cause, Contains("no path: the way is clear up to "));

  blocked["way"] = {{"type", "arc"}, {"through_m", {5.0, 0.0, 0.5}}};
  result = simulation::run(shelf_with(Json::array({blocked}), 1.0), plugin_directories, {});
  CHECK_THAT(result.cause, Contains("no path: arc: its ends and the point between them"));

  result = simulation::run(
      shelf_with(
          Json::array({Json{{"type", "any_of"}, {"any_of", {out_of_reach(), out_of_reach()}}}}),
          1.0),
      plugin_directories, {});
  CHECK(result.outcome == log::Outcome::timeout);
  CHECK_THAT(result.cause, Contains("no clear configuration was found at any of 2 goals"));
}

TEST_CASE("planners that follow no paths are refused for goals that need one",
          "[simulation][goals]") {
  const auto refusal = [](const Json& goal) {
    scene::Scene scene = shelf_with(Json::array({goal}));
    scene.planner->name = "apf";
    return test::error_of([&] { (void)simulation::run(scene, plugin_directories, {}); });
  };
  CHECK_THAT(refusal({{"type", "any_of"}, {"any_of", Json::array({shelf_goal(0)})}}),
             Contains("/goals/0: any_of: planner 'apf' moves without a path"));
  Json goal = shelf_goal(0);
  goal["free_axis"] = {0, 0, 1};
  CHECK_THAT(refusal(goal), Contains("/goals/0: free_axis: planner 'apf' moves without a path"));
  CHECK_THAT(refusal(with_approach(shelf_goal(0), 0.1)),
             Contains("/goals/0: approach: planner 'apf' moves without a path"));
}

TEST_CASE("postures at a goal are clear, and differ", "[simulation][goals]") {
  const scene::Scene scene = shelf_with(Json::array({shelf_goal(0)}));
  const search::Postures postures = control::find_postures(scene, 0, {8, 0.2, 2000});
  CHECK(postures.found.size() == 8);
  CHECK(postures.figures.reached >= postures.figures.clear);
  CHECK(postures.figures.clear >= 8);
  for (std::size_t i = 0; i < postures.found.size(); ++i) {
    CHECK(postures.found[i].clearance_m > 0.0);
    for (std::size_t k = 0; k < i; ++k)
      CHECK((postures.found[i].q - postures.found[k].q).lpNorm<Eigen::Infinity>() >= 0.2);
  }
  CHECK_THAT(test::error_of([&] { (void)control::find_postures(scene, 1, {}); }),
             Contains("/goals/1: does not exist"));
}

TEST_CASE("goals that are passed are reached at speed, within their tolerances and all limits",
          "[simulation][goals]") {
  Json goals = Json::array();
  const Json home = shelf_goal(1)["q"];
  for (const std::vector<double>& by : {std::vector<double>{0.5, 0.2, 0.1},
                                        {0.9, -0.1, 0.2},
                                        {0.4, -0.3, -0.1},
                                        {-0.3, 0.1, 0.3}}) {
    Json q = home;
    for (std::size_t j = 0; j < by.size(); ++j) q[j] = q[j].get<double>() + by[j];
    goals.push_back({{"type", "joint"}, {"q", q}, {"tolerance_rad", 0.08}});
  }
  const auto run = [&](bool passes, double& slowest) {
    Json given = goals;
    if (passes)
      for (std::size_t i = 0; i + 1 < given.size(); ++i) given[i]["pass"] = true;
    const scene::Scene scene = shelf_with(given, 20.0);
    // the slowest that the arm is between the first goal and the last
    simulation::Watch watch;
    Eigen::VectorXd before;
    double before_s = 0.0;
    slowest = 1e9;
    bool began = false;
    watch.at_node = [&](double time_s, const Eigen::VectorXd& q) {
      const Eigen::VectorXd last = test::vector_of(given.back()["q"]),
                            first = test::vector_of(given[0]["q"]);
      const bool between = began && (q - last).lpNorm<Eigen::Infinity>() > 0.3;
      began = began || (q - first).lpNorm<Eigen::Infinity>() < 0.08;
      if (before.size() > 0 && between)
        slowest = std::min(slowest, (q - before).lpNorm<Eigen::Infinity>() / (time_s - before_s));
      before = q;
      before_s = time_s;
    };
    return simulation::run(scene, plugin_directories, watch);
  };
  double resting = 0.0, passing = 0.0;
  const log::Result stops = run(false, resting), passes = run(true, passing);
  REQUIRE(stops.outcome == log::Outcome::reached);
  REQUIRE(passes.outcome == log::Outcome::reached);
  CHECK(passes.certified_share == 1.0);
  CHECK(passes.time_s < stops.time_s - 0.1);
  CHECK(resting < 0.05);
  CHECK(passing > 0.5);
  CHECK(*passes.speed_excess <= 0.0);
}

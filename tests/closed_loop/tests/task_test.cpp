// Tasks: objects that are obstacles while they stand, and loads while they are held.
#include <catch2/catch.hpp>

#include "../scratch_scene.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/task/task.hpp"

using namespace hamelin;
using Catch::Contains;
using Eigen::Vector3d;
using test::plugin_directories;

namespace {

const std::filesystem::path tasks = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data" / "tasks";

scene::Scene planned(const char* name, const std::vector<std::string>& assignments = {}) {
  Json document = read_json(tasks / name);
  for (const std::string& assignment : assignments) {
    const auto equals = assignment.find('=');
    document[Json::json_pointer(assignment.substr(0, equals))] =
        Json::parse(assignment.substr(equals + 1));
  }
  const task::TaskPlan plan = task::plan_task(task::task_from_json(document, tasks, name));
  REQUIRE(plan.cause.empty());
  return plan.scene;
}

scene::Obstacle block(const std::string& name, const Vector3d& at) {
  scene::Obstacle out;
  out.name = name;
  out.shape = scene::Shape::sphere;
  out.radius_m = 0.03;
  out.pose = {Eigen::Matrix3d::Identity(), at};
  return out;
}

}  // namespace

TEST_CASE("tasks are done without touching but what steps allow", "[simulation][task]") {
  for (const char* name : {"table.json", "shelf.json"}) {
    INFO(name);
    const log::Result result = simulation::run(planned(name), plugin_directories, {});
    CHECK(result.outcome == log::Outcome::reached);
    CHECK(result.certified_share == 1.0);
    CHECK(*result.min_clearance_m > 0.002);
    for (const auto& constraint : result.constraints) CHECK(constraint.excess < 0.0);
    CHECK(result.warnings.empty());
  }
}

TEST_CASE("what is put down is an obstacle again, where it was left", "[simulation][task]") {
  // the last ways must not touch any more what they leave
  scene::Scene scene = planned("table.json", {"/objects/0/grasps/0/position_m/0=-0.04",
                                              "/objects/0/grasps/1/position_m/2=0.07"});
  CHECK(simulation::run(scene, plugin_directories, {}).outcome == log::Outcome::reached);
  REQUIRE(scene.goals.size() == 15);
  for (const std::size_t i : {5u, 6u}) std::erase(scene.goals[i].may_touch.obstacles, "can");
  const log::Result result = simulation::run(scene, plugin_directories, {});
  CHECK(result.outcome != log::Outcome::reached);
  CHECK_THAT(result.cause, Contains("obstacle 'can'"));
}

TEST_CASE("what is held is no obstacle where it was", "[simulation][task]") {
  scene::Scene scene = planned("table.json");
  // the same, but the can is not taken out of the world when it is attached
  scene.events.front().obstacle.clear();
  const log::Result result = simulation::run(scene, plugin_directories, {});
  CHECK(result.outcome != log::Outcome::reached);
  CHECK_THAT(result.cause, Contains("can"));
}

TEST_CASE("an obstacle that the arm was refused is where it was", "[simulation][task]") {
  scene::Scene scene = planned("table.json");
  scene.events.front().required = false;
  scene.events.front().attach->mass_kg = 40.0;
  const log::Result result = simulation::run(scene, plugin_directories, {});
  REQUIRE_FALSE(result.warnings.empty());
  CHECK_THAT(result.warnings.front(), Contains("'can' cannot be attached"));
  CHECK(result.outcome != log::Outcome::reached);  // goals lead through the can, which still stands
}

TEST_CASE("obstacles that nobody carries stay what they are", "[simulation][task]") {
  scene::Scene scene = planned("table.json");
  scene.obstacles.push_back(block("beside", {0.9, 0.55, 0.3}));
  CHECK(simulation::run(scene, plugin_directories, {}).outcome == log::Outcome::reached);
}

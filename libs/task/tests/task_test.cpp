#include <catch2/catch.hpp>

#include <Eigen/Geometry>
#include <cmath>
#include <string>

#include "hamelin/core/error.hpp"
#include "hamelin/fit/coverage.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/task/task.hpp"

using namespace hamelin;
using Catch::Matchers::Contains;
using Eigen::Vector3d;

namespace {

const std::filesystem::path tasks = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/tasks";

Json document_of(const char* name) {
  return read_json(tasks / name);
}

std::string refused(const Json& document) {
  try {
    (void)task::task_from_json(document, tasks, "task");
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

double inside(const scene::Payload& payload, const Vector3d& p) {
  double least = 1.0;
  for (const auto& sphere : payload.spheres)
    least = std::min(least, (sphere.center_m - p).norm() - sphere.radius_m);
  for (const auto& capsule : payload.capsules)
    least =
        std::min(least, fit::segment_distance(capsule.from_m, capsule.to_m, p) - capsule.radius_m);
  return least;
}

}  // namespace

TEST_CASE("a plan's goals and events do what the steps say", "[task][unit]") {
  const task::Task given = task::task_from_json(document_of("table.json"), tasks, "table");
  const task::TaskPlan plan = task::plan_task(given);
  REQUIRE(plan.found());
  REQUIRE(plan.steps.size() == 5);
  // three goals per pick, four per place, one per move
  REQUIRE(plan.scene.goals.size() == 15);
  REQUIRE(plan.scene.events.size() == 4);
  CHECK(plan.scene.events[0].obstacle == "can");
  CHECK(*plan.scene.events[0].goals_reached == 2);
  CHECK(*plan.scene.events[1].detach == "can");
  CHECK(*plan.scene.events[1].goals_reached == 5);
  // what is carried is kept upright, on the way between the straight ones
  for (std::size_t i = 0; i < 15; ++i)
    CHECK(plan.scene.goals[i].constraints.size() == (i == 3 ? 1 : 0));
  // only straight ways may touch anything
  for (const scene::Goal& goal : plan.scene.goals)
    CHECK((goal.may_touch.empty() || goal.way.has_value()));
  // the object is put down where it is said to be: its load's frame at the end of the way down
  const geometry::SE3 tip = plan.scene.goals[4].pose;
  const Vector3d can = tip * plan.scene.events[0].attach->position_m;
  CHECK((can - Vector3d(0.5, -0.25, 0.163)).norm() < 2e-3);
  // a scene file has all of it
  const Json written = scene::resolved_json(plan.scene);
  const scene::Scene again = scene::scene_from_json(written, ".", "again");
  CHECK(scene::resolved_json(again) == written);
}

TEST_CASE("the same task and seed give the same plan", "[task][unit]") {
  const task::Task given = task::task_from_json(document_of("shelf.json"), tasks, "shelf");
  const Json first = scene::resolved_json(task::plan_task(given).scene);
  CHECK(first == scene::resolved_json(task::plan_task(given).scene));
}

TEST_CASE("a load covers its object and has its mass and inertia", "[task][unit]") {
  task::Object object;
  object.solid.name = "thing";
  object.mass_kg = 2.0;
  const auto seen = [&](const Vector3d& p) { return inside(task::payload_of(object), p); };
  SECTION("a box") {
    object.solid.shape = scene::Shape::box;
    object.solid.size_m = {0.1, 0.06, 0.04};
    const scene::Payload load = task::payload_of(object);
    for (int i = 0; i < 8; ++i)
      CHECK(inside(load, {i & 1 ? 0.05 : -0.05, i & 2 ? 0.03 : -0.03, i & 4 ? 0.02 : -0.02}) <=
            0.0);
    CHECK(inside(load, {0.0, 0.0, 0.02}) <= 0.0);
    CHECK(inside(load, {0.06, 0.0, 0.0}) > 0.003);
    CHECK(load.inertia_kg_m2(0, 0) == Approx(2.0 / 12.0 * (0.06 * 0.06 + 0.04 * 0.04)));
  }
  SECTION("a cylinder") {
    object.solid.shape = scene::Shape::cylinder;
    object.solid.radius_m = 0.03;
    object.solid.length_m = 0.1;
    const scene::Payload load = task::payload_of(object);
    for (int k = 0; k < 36; ++k)
      for (const double z : {-0.05, 0.0, 0.05})
        CHECK(inside(load, {0.03 * std::cos(k * 0.1745), 0.03 * std::sin(k * 0.1745), z}) <= 0.0);
    CHECK(inside(load, {0.04, 0.0, 0.0}) > 0.003);
    CHECK(load.inertia_kg_m2(2, 2) == Approx(0.5 * 2.0 * 0.03 * 0.03));
  }
  SECTION("a capsule, whose moments are those of its voxels") {
    object.solid.shape = scene::Shape::capsule;
    object.solid.radius_m = 0.03;
    object.solid.length_m = 0.08;
    CHECK(seen({0.0, 0.0, 0.07}) == Approx(0.0).margin(1e-12));
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    double count = 0.0;
    constexpr double step = 0.001;
    for (double x = -0.03 + 0.5 * step; x < 0.03; x += step)
      for (double y = -0.03 + 0.5 * step; y < 0.03; y += step)
        for (double z = -0.07 + 0.5 * step; z < 0.07; z += step) {
          const Vector3d p(x, y, z);
          if (fit::segment_distance({0, 0, -0.04}, {0, 0, 0.04}, p) > 0.03) continue;
          sum += p.squaredNorm() * Eigen::Matrix3d::Identity() - p * p.transpose();
          count += 1.0;
        }
    const scene::Payload load = task::payload_of(object);
    CHECK((load.inertia_kg_m2 - 2.0 / count * sum).norm() < 5e-3 * load.inertia_kg_m2.norm());
  }
  SECTION("held by a tip, it is where the object is") {
    object.solid.shape = scene::Shape::sphere;
    object.solid.radius_m = 0.03;
    const geometry::SE3 grasp(Eigen::Matrix3d(Eigen::AngleAxisd(0.5, Vector3d::UnitX())),
                              {0.1, 0.0, 0.02});
    const scene::Payload load = task::held_at(grasp, task::payload_of(object));
    CHECK((grasp * load.position_m).norm() < 1e-15);
    CHECK((grasp * load.spheres.front().center_m).norm() < 1e-15);
  }
}

TEST_CASE("bad tasks are refused in one line that names the place", "[task][unit]") {
  Json document = document_of("table.json");
  const auto with = [&](const char* pointer, const Json& value) {
    Json changed = document;
    changed[Json::json_pointer(pointer)] = value;
    return refused(changed);
  };
  CHECK(refused(document).empty());
  CHECK_THAT(with("/steps/0/object", "cann"),
             Contains("/steps/0/object: there is no object 'cann'") && Contains("'can'"));
  CHECK_THAT(with("/steps/0/tilt_rad", 0.1), Contains("/steps/0/tilt_rad: is not allowed"));
  CHECK_THAT(with("/steps/1", {{"type", "pick"}, {"object", "box"}}),
             Contains("/steps/1: 'can' is held already"));
  CHECK_THAT(with("/steps/0", {{"type", "place"}, {"position_m", {0, 0, 0}}}),
             Contains("/steps/0: nothing is held"));
  CHECK_THAT(with("/steps/4", {{"type", "move"}}), Contains("/steps/4/goal: is missing"));
  CHECK_THAT(with("/objects/0/stands_on/obstacles/0", "tabel"),
             Contains("/objects/0/stands_on/obstacles: there is no obstacle 'tabel'"));
  CHECK_THAT(with("/objects/0/name", "table"), Contains("/objects/0/name: 'table' is the name"));
  CHECK_THAT(with("/objects/0/in_map", true), Contains("/objects/0/in_map"));
  CHECK_THAT(with("/objects/0/radius_m", nullptr), Contains("/objects/0"));
  CHECK_THAT(with("/objects/0/grasps/0/quaternion_wxyz", {1, 1, 0, 0}),
             Contains("unit quaternion"));
  CHECK_THAT(with("/scene/goals", document["steps"]), Contains("/scene/goals: is given"));
  CHECK_THAT(with("/scene/start/q", {"a"}), Contains("/scene"));
}

TEST_CASE("a task that cannot be done says which step fails, and where", "[task][unit]") {
  Json document = document_of("table.json");
  SECTION("out of reach") {
    document["steps"][1]["position_m"] = {2.0, 0.0, 0.16};
    const task::TaskPlan plan = task::plan_task(task::task_from_json(document, tasks, "task"));
    CHECK_FALSE(plan.found());
    CHECK_THAT(plan.cause, Contains("step 2 (place)"));
  }
  SECTION("under a box") {
    document["scene"]["obstacles"].push_back({{"name", "cover"},
                                              {"type", "box"},
                                              {"size_m", {0.3, 0.3, 0.3}},
                                              {"position_m", {0.5, 0.25, 0.25}}});
    const task::TaskPlan plan = task::plan_task(task::task_from_json(document, tasks, "task"));
    CHECK_FALSE(plan.found());
    CHECK_THAT(plan.cause, Contains("step 1 (pick 'can')"));
  }
}

#include <catch2/catch.hpp>
#include <cmath>

#include "ball.hpp"
#include "hamelin/control/world.hpp"
#include "hamelin/control/world_view.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/test/arm_loop.hpp"
#include "hamelin/test/errors.hpp"

using namespace hamelin;
using Catch::Contains;
using Eigen::Vector3d;

namespace {

scene::Scene scene_with_voxels() {
  scene::Scene scene;
  scene.name = "scene.json";
  scene.map.emplace();
  scene.map->resolution_m = 0.1;
  return scene;
}

// Distance of a point from the world with an allowance, at most 1 m.
double distance_with(const control::World& world, const Vector3d& p, std::uint64_t allowance) {
  const double no_radius = 0.0;
  return world.latest(allowance)->environment.clearance({{&p, 1}, {&no_radius, 1}}, 0.0, 1.0);
}

}  // namespace

TEST_CASE("a world tells how it is without what may be touched, after each update",
          "[control][world][touch]") {
  const model::Model arm(test::planar4());
  control::World world(scene_with_voxels(), arm, {0.5, 4});
  scene::MapChangeSpec wall;
  wall.occupied_m = {{{1.0, -1.0, -0.5}, {1.2, 1.0, 0.5}}};
  world.change_map(wall);
  world.set_obstacle(test::ball("a", {0.0, 2.0, 0.0}));
  const scene::Allowance of_map{{{{1.0, -0.2, -0.2}, {1.2, 0.2, 0.2}}}, {}}, of_ball{{}, {"a"}};
  const auto ids = world.allow({of_map, {}, of_ball});
  REQUIRE(ids.size() == 3);
  CHECK(ids[1] == 0);
  CHECK(ids[0] != ids[2]);

  const Vector3d in_wall(1.1, 0.0, 0.0), in_ball(0.0, 2.0, 0.0);
  CHECK(distance_with(world, in_wall, 0) <= 0.0);
  CHECK(distance_with(world, in_wall, ids[0]) == Approx(0.2));
  CHECK(distance_with(world, in_wall, ids[2]) <= 0.0);
  CHECK(distance_with(world, in_ball, ids[0]) == Approx(-0.1));
  CHECK(distance_with(world, in_ball, ids[2]) > 0.9);

  SECTION("obstacles and maps that change later are known with each of them") {
    world.set_obstacle(test::ball("b", {1.1, 0.0, 0.0}));
    CHECK(distance_with(world, in_wall, ids[0]) == Approx(-0.1));
    world.remove_obstacle("b");
    scene::MapChangeSpec more;
    more.occupied_m = {{{1.0, -0.1, -0.1}, {1.2, 0.1, 0.1}}, {{0.0, 1.9, 0.0}, {0.1, 2.0, 0.1}}};
    world.change_map(more);
    CHECK(distance_with(world, in_wall, ids[0]) == Approx(0.2));
    CHECK(distance_with(world, {0.05, 1.95, 0.05}, ids[2]) <= 0.0);
  }
  SECTION("numbers grow, and what stands still has another one if it changes") {
    const auto before = world.latest(), without = world.latest(ids[0]);
    CHECK(without->number > before->number);
    CHECK(without->standing != before->standing);
    const std::uint64_t number =
        world.move_obstacle("a", before->environment.obstacles()[0].pose, {0.0, 0.0, 0.0}, 1.0);
    CHECK(number > without->number);  // it stood until now
    CHECK(world.latest(ids[0])->standing > without->standing);
    const auto moving = world.latest(ids[0]);
    world.move_obstacle("a", before->environment.obstacles()[0].pose, {0.0, 0.0, 0.0}, 2.0);
    CHECK(world.latest(ids[0])->standing == moving->standing);
    CHECK(world.latest(ids[0])->number != moving->number);
  }
  SECTION("the same allowance keeps its number, and old ones are forgotten") {
    CHECK(world.allow({of_map})[0] == ids[0]);
    CHECK(distance_with(world, in_ball, ids[2]) > 0.9);
    CHECK(world.allow({of_map})[0] == ids[0]);
    CHECK(distance_with(world, in_ball, ids[2]) == Approx(-0.1));
    (void)world.allow({{}});
    (void)world.allow({{}});
    CHECK(world.latest()->allowed.empty());
    CHECK(distance_with(world, in_wall, ids[0]) <= 0.0);
  }
  SECTION("a view takes it with the next snapshot") {
    control::WorldView view(scene_with_voxels(), arm, world);
    const Eigen::VectorXd q = Eigen::VectorXd::Zero(arm.dof());
    CHECK_FALSE(view.allow(0));
    CHECK(view.allow(ids[2]));
    CHECK(view.allowance() == ids[2]);
    CHECK(view.snapshot() == world.latest(ids[2])->number);
    view.look(q, 0.0);
    CHECK(view.whole_clearance_m() <= view.clearance_m());
    CHECK(view.allow(0));
    CHECK(view.snapshot() == world.latest()->number);
  }
}

TEST_CASE("what may be touched is checked", "[control][world][touch]") {
  const model::Model arm(test::planar4());
  control::World world(scene_with_voxels(), arm, {0.5, 4});
  const auto number = world.latest()->number;
  CHECK_THAT(test::error_of([&] {
               (void)world.allow({{{{{0.0, 0.0, 0.0}, {0.0, 1.0, 1.0}}}, {}}});
             }),
             Contains("may_touch/boxes_m/0: the low corner is not below the high one"));
  CHECK_THAT(test::error_of([&] {
               (void)world.allow({{{{{0.0, 0.0, 0.0}, {std::nan(""), 1.0, 1.0}}}, {}}});
             }),
             Contains("may_touch/boxes_m/0: is not finite"));
  CHECK_THAT(test::error_of([&] {
               world.require_obstacles({{}, {"a"}});
             }),
             Contains("obstacle 'a': there is none of this name"));
  CHECK(world.latest()->number == number);
}

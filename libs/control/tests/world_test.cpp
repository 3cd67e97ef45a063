#include <atomic>
#include <catch2/catch.hpp>
#include <random>
#include <thread>

#include "hamelin/control/world.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/arm_loop.hpp"

using namespace hamelin;
using Catch::Contains;
using Catch::Equals;
using Eigen::Vector3d;

namespace {

scene::Scene empty_scene() {
  scene::Scene scene;
  scene.name = "scene.json";
  return scene;
}

scene::Obstacle ball(const std::string& name, const Vector3d& at, double radius = 0.1) {
  scene::Obstacle out;
  out.name = name;
  out.radius_m = radius;
  out.pose = {Eigen::Matrix3d::Identity(), at};
  return out;
}

std::string message_of(const std::function<void()>& update) {
  try {
    update();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("obstacles of a world are added, replaced, moved and removed, and keep their ids",
          "[control][world]") {
  const model::Model arm(test::planar4());
  control::World world(empty_scene(), arm, {0.5, 2});
  const auto ids = [&] { return world.latest()->obstacle_ids; };
  const auto obstacles = [&] { return world.latest()->environment.obstacles(); };
  CHECK(world.latest()->number == 0);
  CHECK(world.set_obstacle(ball("a", {1.0, 0.0, 0.0})) == 1);
  CHECK(world.set_obstacle(ball("b", {2.0, 0.0, 0.0})) == 2);
  CHECK(ids() == std::vector<std::int32_t>{0, 1});
  CHECK(world.set_obstacle(ball("a", {1.0, 0.5, 0.0}, 0.2)) == 3);
  CHECK(ids() == std::vector<std::int32_t>{0, 1});
  CHECK(obstacles()[0].radius_m == 0.2);
  world.move_obstacle("b", {Eigen::Matrix3d::Identity(), {2.0, 1.0, 0.0}}, {0.1, 0.0, 0.0}, 3.0);
  CHECK(scene::motion_at(obstacles()[1], 3.0).pose.p().isApprox(Vector3d(2.0, 1.0, 0.0)));
  CHECK(scene::motion_at(obstacles()[1], 5.0).pose.p().isApprox(Vector3d(2.2, 1.0, 0.0)));
  world.remove_obstacle("a");
  CHECK(ids() == std::vector<std::int32_t>{1});
  world.set_obstacle(ball("a", {1.0, 0.0, 0.0}));
  CHECK(ids() == std::vector<std::int32_t>{1, 2});  // an id is not used twice
}

TEST_CASE("an update that cannot be applied names what is wrong and changes nothing",
          "[control][world]") {
  const model::Model arm(test::planar4());
  control::World world(empty_scene(), arm, {0.5, 1});
  world.set_obstacle(ball("a", {1.0, 0.0, 0.0}));
  const auto before = world.latest();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const geometry::SE3 here;
  CHECK_THAT(message_of([&] { world.remove_obstacle("b"); }),
             Equals("obstacle 'b': there is none of this name, expected one of the 1 that exist"));
  CHECK_THAT(message_of([&] { world.move_obstacle("b", here, Vector3d::Zero(), 0.0); }),
             Contains("obstacle 'b'"));
  CHECK_THAT(message_of([&] {
               world.move_obstacle("a", here, {nan, 0.0, 0.0}, 0.0);
             }),
             Contains("obstacle 'a'") && Contains("not finite"));
  CHECK_THAT(message_of([&] {
               world.set_obstacle(ball("a", {0.0, nan, 0.0}));
             }),
             Contains("obstacle 'a'") && Contains("not finite"));
  CHECK_THAT(message_of([&] {
               world.set_obstacle(ball("a", {0.0, 0.0, 0.0}, -1.0));
             }),
             Contains("obstacle 'a'"));
  CHECK_THAT(message_of([&] {
               world.set_obstacle(ball("", {0.0, 0.0, 0.0}));
             }),
             Contains("no name"));
  CHECK_THAT(message_of([&] {
               scene::Obstacle hidden = ball("a", {0.0, 0.0, 0.0});
               hidden.known = false;
               world.set_obstacle(hidden);
             }),
             Contains("obstacle 'a'") && Contains("hidden from the planner"));
  CHECK_THAT(message_of([&] {
               world.set_obstacle(ball("b", {0.0, 0.0, 0.0}));
             }),
             Contains("obstacle 'b'") && Contains("1 already"));
  CHECK_THAT(message_of([&] { world.change_map({}); }), Contains("map"));
  scene::MapSpec no_file;
  no_file.file = "no_such_map.bt";
  CHECK_THAT(message_of([&] { world.set_map(no_file); }), Contains("no_such_map.bt"));
  CHECK(world.latest() == before);
}

TEST_CASE("a map that is changed in parts gives the distances of the whole change",
          "[control][world]") {
  const model::Model arm(test::planar4());
  scene::Scene scene = empty_scene();
  scene.map.emplace();
  scene.map->file = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/maps/clutter.bt";
  control::World world(scene, arm, {0.5});
  const auto before = world.latest();
  scene::MapChangeSpec change;
  change.free_m = {{{-1.0, -1.0, 0.0}, {0.0, 1.0, 1.0}}};
  change.occupied_m = {{{0.4, 0.4, 0.0}, {0.5, 0.6, 0.2}}};
  world.change_map(change);

  scene.map->changes = {change};
  scene::Environment expected = scene::make_environment(scene, arm, 0.5);
  CHECK(!expected.advance(0.0).empty());
  const std::array<double, 1> point{0.0};
  const auto clearance = [&](const scene::Environment& environment, const Vector3d& p) {
    return environment.clearance({{&p, 1}, point}, 0.0, 1.0);
  };
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-0.8, 0.8);
  int changed = 0;
  for (int i = 0; i < 200; ++i) {
    const Vector3d p(uniform(random), uniform(random), 0.5 + uniform(random));
    const auto now = world.latest();
    CHECK(clearance(now->environment, p) == clearance(expected, p));
    changed += clearance(now->environment, p) != clearance(before->environment, p) ? 1 : 0;
  }
  CHECK(changed > 20);
}

TEST_CASE("a control loop sees whole snapshots while two threads update them, without allocating",
          "[control][world]") {
  const model::Model arm(test::planar4());
  scene::Scene scene = empty_scene();
  scene.map.emplace();
  scene.map->file = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/maps/clutter.bt";
  control::World world(scene, arm, {0.5, 8});
  std::atomic<bool> stop{false};
  std::thread obstacles([&] {
    std::mt19937 random(2);
    for (int i = 0; !stop; ++i) {
      const std::string name = "ball " + std::to_string(random() % 6);
      const Vector3d at(0.1 * static_cast<double>(random() % 30), 0.3, 0.2);
      if (i % 3 < 2)
        world.set_obstacle(ball(name, at));
      else if (!world.latest()->environment.obstacles().empty())
        world.remove_obstacle(world.latest()->environment.obstacles().front().name);
    }
  });
  std::thread map([&] {
    for (int i = 0; !stop; ++i) {
      scene::MapChangeSpec change;
      (i % 2 == 0 ? change.free_m : change.occupied_m) = {{{0.2, 0.2, 0.0}, {0.4, 0.4, 0.2}}};
      world.change_map(change);
    }
  });

  const std::vector<Vector3d> centers{{0.5, 0.3, 0.2}, {1.5, 0.2, 0.1}};
  const std::vector<double> radii{0.05, 0.1};
  std::vector<scene::Contact> contacts(world.contacts_max());
  long allocations = 0, seen = 0, mismatches = 0;
  std::uint64_t last = 0;
  const scene::Shapes shapes{centers, radii};
  constexpr long ticks_max = 100'000'000;
  for (long tick = 0; seen < 300 && tick < ticks_max; ++tick) {
    control::World::View* view = nullptr;
    std::size_t found = 0;
    allocations += test::allocations_in([&] {
      view = &world.take();
      found = view->snapshot->environment.closest(shapes, 0.5, 0.0, view->scratch, contacts);
    });
    if (view->snapshot->number < last) ++mismatches;
    if (view->snapshot->number == last && tick > 0) continue;
    last = view->snapshot->number;
    ++seen;
    if (view->snapshot->obstacle_ids.size() != view->snapshot->environment.obstacles().size())
      ++mismatches;
    double nearest = 0.5;
    for (std::size_t i = 0; i < std::min(found, contacts.size()); ++i)
      nearest = std::min(nearest, contacts[i].distance);
    if (nearest != view->snapshot->environment.clearance(shapes, 0.0, 0.5)) ++mismatches;
  }
  stop = true;
  obstacles.join();
  map.join();
  CHECK(seen == 300);
  CHECK(mismatches == 0);
  if (test::counts_allocations()) CHECK(allocations == 0);
}

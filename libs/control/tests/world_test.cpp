#include <atomic>
#include <catch2/catch.hpp>
#include <random>
#include <thread>

#include "ball.hpp"
#include "hamelin/control/world.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/geometry/so3.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/arm_loop.hpp"
#include "hamelin/test/errors.hpp"

using namespace hamelin;
using Catch::Contains;
using Catch::Equals;
using Eigen::Vector3d;
using test::ball;

namespace {

scene::Scene empty_scene() {
  scene::Scene scene;
  scene.name = "scene.json";
  return scene;
}

control::Observation seen(double time_s, const Vector3d& at) {
  return {time_s, {Eigen::Matrix3d::Identity(), at}};
}

// The motion of the first obstacle, which has been observed.
scene::ObservedMotion observed(const control::World& world) {
  return std::get<scene::ObservedMotion>(*world.latest()->environment.obstacles().front().motion);
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
  CHECK_THAT(test::error_of([&] { world.remove_obstacle("b"); }),
             Equals("obstacle 'b': there is none of this name, expected one of the 1 that exist"));
  CHECK_THAT(test::error_of([&] { world.move_obstacle("b", here, Vector3d::Zero(), 0.0); }),
             Contains("obstacle 'b'"));
  CHECK_THAT(test::error_of([&] {
               world.move_obstacle("a", here, {nan, 0.0, 0.0}, 0.0);
             }),
             Contains("obstacle 'a'") && Contains("not finite"));
  CHECK_THAT(test::error_of([&] {
               world.set_obstacle(ball("a", {0.0, nan, 0.0}));
             }),
             Contains("obstacle 'a'") && Contains("not finite"));
  CHECK_THAT(test::error_of([&] {
               world.set_obstacle(ball("a", {0.0, 0.0, 0.0}, -1.0));
             }),
             Contains("obstacle 'a'"));
  CHECK_THAT(test::error_of([&] {
               world.set_obstacle(ball("", {0.0, 0.0, 0.0}));
             }),
             Contains("no name"));
  CHECK_THAT(test::error_of([&] {
               scene::Obstacle hidden = ball("a", {0.0, 0.0, 0.0});
               hidden.known = false;
               world.set_obstacle(hidden);
             }),
             Contains("obstacle 'a'") && Contains("hidden from the planner"));
  CHECK_THAT(test::error_of([&] {
               world.set_obstacle(ball("b", {0.0, 0.0, 0.0}));
             }),
             Contains("obstacle 'b'") && Contains("1 already"));
  CHECK_THAT(test::error_of([&] { world.change_map({}); }), Contains("map"));
  scene::MapSpec no_file;
  no_file.file = "no_such_map.bt";
  CHECK_THAT(test::error_of([&] { world.set_map(no_file); }), Contains("no_such_map.bt"));
  CHECK(world.latest() == before);
}

TEST_CASE("an observed obstacle goes on with the velocity of its poses, or with what is given",
          "[control][world][tracking]") {
  const model::Model arm(test::planar4());
  control::World world(empty_scene(), arm, {0.5, 2});
  world.set_obstacle(ball("a", {1.0, 0.0, 0.0}));
  CHECK(!world.last_observed("a"));
  const Vector3d velocity(0.2, -0.3, 0.1);
  double time_s = 4.0;
  for (int k = 0; k < 100; ++k) {
    time_s += 0.01 + 0.01 * (k % 3);
    CHECK(world.observe_obstacle("a", seen(time_s, time_s * velocity)) ==
          2 + static_cast<std::uint64_t>(k));
    if (k == 0) CHECK(observed(world).velocity_m_s.isZero(0.0));
  }
  CHECK(world.last_observed("a") == time_s);
  CHECK((observed(world).velocity_m_s - velocity).norm() < 1e-3);
  CHECK(observed(world).acceleration_m_s2.norm() < 1e-2);
  CHECK(observed(world).angular_velocity_rad_s.norm() < 1e-12);
  // Poses are old when they arrive: at the time of a tick the obstacle has moved on.
  const auto now = scene::motion_at(world.latest()->environment.obstacles().front(), time_s + 0.05);
  CHECK((now.pose.p() - (time_s + 0.05) * velocity).norm() < 1e-4);

  control::Observation given = seen(time_s + 0.02, {0.0, 0.0, 1.0});
  given.velocity_m_s = {0.0, 1.0, 0.0};
  given.acceleration_m_s2 = {0.0, 0.0, 2.0};
  given.angular_velocity_rad_s = {3.0, 0.0, 0.0};
  world.observe_obstacle("a", given);
  CHECK(observed(world).velocity_m_s == *given.velocity_m_s);
  CHECK(observed(world).acceleration_m_s2 == *given.acceleration_m_s2);
  CHECK(observed(world).angular_velocity_rad_s == *given.angular_velocity_rad_s);
}

TEST_CASE("a stream starts again at rest after a gap, and when its obstacle is set or moved",
          "[control][world][tracking]") {
  const model::Model arm(test::planar4());
  control::World::Options options{0.5, 2};
  options.observations.timeout_s = 0.25;
  control::World world(empty_scene(), arm, options);
  world.set_obstacle(ball("a", {1.0, 0.0, 0.0}));
  double time_s = 0.0;
  const auto observe_after = [&](double elapsed_s) {
    time_s += elapsed_s;
    world.observe_obstacle("a", seen(time_s, {time_s, 0.0, 0.0}));
    return observed(world).velocity_m_s;
  };
  const auto stream = [&] {
    for (int k = 0; k < 50; ++k) observe_after(0.02);
    CHECK(observed(world).velocity_m_s.x() == Approx(1.0).epsilon(0.02));
  };
  stream();
  CHECK(observe_after(0.24).x() == Approx(1.0).epsilon(0.02));
  CHECK(observe_after(0.26).isZero(0.0));
  stream();
  world.move_obstacle("a", {}, {0.5, 0.0, 0.0}, time_s += 0.01);
  CHECK(world.last_observed("a") == time_s);
  CHECK(observe_after(0.01).isZero(0.0));
  stream();
  world.set_obstacle(ball("a", {1.0, 0.0, 0.0}));
  CHECK(!world.last_observed("a"));
  world.observe_obstacle("a", seen(0.5, {0.0, 0.0, 0.0}));  // it has no last time any more
  CHECK(observed(world).velocity_m_s.isZero(0.0));
}

TEST_CASE("observations that cannot be right are refused and change nothing",
          "[control][world][tracking]") {
  const model::Model arm(test::planar4());
  control::World world(empty_scene(), arm, {0.5, 3});
  scene::Obstacle bounded = ball("a", {0.0, 0.0, 0.0});
  bounded.speed_max_m_s = 0.5;
  world.set_obstacle(bounded);
  scene::Obstacle known = ball("known", {0.0, 0.0, 0.0});
  known.motion = scene::SineMotion{{0.1, 0.0, 0.0}, 2.0};
  known.prediction = scene::Prediction::path;
  world.set_obstacle(known);
  world.observe_obstacle("a", seen(2.0, {0.0, 0.0, 0.0}));
  world.observe_obstacle("a", seen(2.01, {0.001, 0.0, 0.0}));
  const auto before = world.latest();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [&](const control::Observation& observation, const char* name = "a") {
    return test::error_of([&] { world.observe_obstacle(name, observation); });
  };
  const Vector3d here(0.002, 0.0, 0.0);
  CHECK_THAT(refused(seen(2.02, here), "b"), Contains("obstacle 'b': there is none of this name"));
  CHECK_THAT(test::error_of([&] { (void)world.last_observed("b"); }),
             Contains("obstacle 'b': there is none of this name"));
  CHECK_THAT(refused(seen(2.01, here)),
             Equals("obstacle 'a': observed at 2.01 s, expected a time after its last observation "
                    "at 2.01 s"));
  CHECK_THAT(refused(seen(1.5, here)), Contains("observed at 1.5 s, expected a time after"));
  CHECK_THAT(refused(seen(nan, here)), Contains("obstacle 'a': its time, velocity") &&
                                           Contains("is not finite, expected finite numbers"));
  CHECK_THAT(refused(seen(2.02, {nan, 0.0, 0.0})), Contains("its pose is not finite"));
  control::Observation wrong = seen(2.02, here);
  wrong.acceleration_m_s2 = {0.0, nan, 0.0};
  CHECK_THAT(refused(wrong), Contains("is not finite"));
  CHECK_THAT(refused(seen(2.02, {0.521, 0.0, 0.0})),
             Equals("obstacle 'a': moved 0.52 m in 0.01 s, expected at most 0.022 m at its "
                    "speed_max of 0.5 m/s, noise included"));
  CHECK_THAT(refused(seen(2.02, here), "known"),
             Equals("obstacle 'known': observed, but its path is known, expected another "
                    "prediction or no motion"));
  CHECK(world.latest() == before);
  // What was refused is not part of the stream; the time that passes allows a longer way.
  world.observe_obstacle("a", seen(2.02, here));
  CHECK(observed(world).velocity_m_s.norm() < 0.3);
  world.observe_obstacle("a", seen(2.5, {0.24, 0.0, 0.0}));
  world.observe_obstacle("a", seen(3.1, {2.0, 0.0, 0.0}));  // a new stream
  CHECK(observed(world).velocity_m_s.isZero(0.0));
  control::World::Options bad{0.5, 3};
  bad.observations.noise_m = -1.0;
  CHECK_THAT(test::error_of([&] { const control::World with(empty_scene(), arm, bad); }),
             Contains("observations: noise_m is -1"));
}

TEST_CASE("what is estimated of an obstacle stays below its stated speed",
          "[control][world][tracking]") {
  const model::Model arm(test::planar4());
  control::World world(empty_scene(), arm, {0.5, 2});
  scene::Obstacle box = ball("a", {0.0, 0.0, 0.0});
  box.shape = scene::Shape::box;
  box.size_m = {0.2, 0.2, 0.2};
  box.speed_max_m_s = 0.2;
  box.prediction = scene::Prediction::speed_bound;
  world.set_obstacle(box);
  Rng rng(2);
  double fastest = 0.0;
  for (int k = 1; k < 500; ++k) {
    const double time_s = 0.01 * k;
    const Vector3d noise(rng.normal(), rng.normal(), rng.normal());
    const geometry::SE3 pose{geometry::SO3::exp({0.0, 0.0, 0.1 * rng.normal()}).R(),
                             0.002 * noise + Vector3d(0.2 * time_s, 0.0, 0.0)};
    world.observe_obstacle("a", {time_s, pose});
    const auto now = world.latest();
    fastest = std::max(fastest, scene::max_speed(now->environment.obstacles().front()));
  }
  CHECK(fastest == Approx(0.2));  // without the bound it would be more
  control::Observation given = seen(5.0, {1.0, 0.0, 0.0});
  given.velocity_m_s = {0.3, 0.0, 0.0};
  CHECK_THAT(test::error_of([&] { world.observe_obstacle("a", given); }),
             Contains("obstacle 'a': its motion reaches 0.3 m/s, expected at most 0.2 m/s"));
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

TEST_CASE("a glance finds the clearances of a look, and a look after it the contacts",
          "[control][world]") {
  const model::Model arm(test::planar4());
  control::World world(empty_scene(), arm, {0.5, 8});
  (void)world.set_obstacle(ball("a", {1.0, 0.6, 0.0}));
  (void)world.set_obstacle(ball("b", {0.5, -0.7, 0.0}));
  control::WorldView looks(empty_scene(), arm, world), glances(empty_scene(), arm, world);
  std::mt19937 rng(4);
  std::uniform_real_distribution<double> angle(-1.0, 1.0);
  int near = 0;
  for (int k = 0; k < 200; ++k) {
    Eigen::VectorXd q(4);
    for (double& x : q) x = angle(rng);
    looks.look(q, 0.0);
    glances.glance(q, 0.0);
    CHECK(glances.clearance_m() == looks.clearance_m());
    CHECK(glances.contacts().empty());
    near += looks.clearance_m() < 0.5 ? 1 : 0;
    glances.look(q, 0.0);
    CHECK(glances.contacts().size() == looks.contacts().size());
    CHECK(glances.clearance_m() == looks.clearance_m());
  }
  CHECK(near > 50);
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

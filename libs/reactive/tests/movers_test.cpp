#include "hamelin/reactive/movers.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "hamelin/test/random_mass.hpp"
#include "hamelin/test/reactive_scene.hpp"

using namespace hamelin;
using Eigen::Vector3d;
using Eigen::VectorXd;
using reactive::MoverPoint;
using reactive::Movers;

namespace {

geometry::SE3 random_pose(Rng& rng) {
  const Eigen::Quaterniond turn = Eigen::Quaterniond(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0),
                                                     rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0))
                                      .normalized();
  return {turn.toRotationMatrix(),
          Vector3d(rng.uniform(-1.2, 1.2), rng.uniform(-1.2, 1.2), rng.uniform(-0.2, 0.2))};
}

scene::Obstacle random_solid(Rng& rng) {
  scene::Obstacle solid;
  solid.shape = std::array{scene::Shape::sphere, scene::Shape::box, scene::Shape::cylinder,
                           scene::Shape::capsule}[rng.below(4)];
  solid.radius_m = rng.uniform(0.03, 0.15);
  solid.length_m = rng.uniform(0.05, 0.4);
  solid.size_m = Vector3d(rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.3));
  solid.pose = random_pose(rng);
  solid.motion = scene::ObservedMotion{
      0.0, Vector3d(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), 0.0),
      Vector3d(rng.uniform(-2.0, 2.0), 0.0, 0.0), Vector3d(0.0, 0.0, rng.uniform(-2.0, 2.0))};
  if (rng.uniform() < 0.3) {
    solid.prediction = scene::Prediction::speed_bound;
    solid.speed_max_m_s = 3.0;
  }
  return solid;
}

/// The fixture's arm with capsules as its last two links.
model::Robot with_capsules() {
  model::Robot robot = test::short_planar4();
  for (std::size_t i = 2; i < 4; ++i) {
    robot.links[i].spheres.clear();
    robot.links[i].segments.push_back({Vector3d(-0.1, 0.0, 0.0), Vector3d(0.1, 0.0, 0.0), 0.025});
  }
  return robot;
}

/// The distance of one shape of an arm from a solid.
double distance(const scene::Shapes& arm, std::size_t i, const scene::Obstacle& solid,
                const scene::Placed& at) {
  const double from = arm.is_capsule(i)
                          ? scene::closest_on(solid, at.pose, arm.from(i), arm.to(i)).distance
                          : scene::closest_on(solid, at.pose, arm.centers[i]).distance;
  return from - arm.radii[i] - at.nearer_m;
}

}  // namespace

TEST_CASE("predicted obstacles are where the host says, and lists of ticks replace each other",
          "[reactive][movers]") {
  auto task = test::joint_task(VectorXd::Zero(4), {{{0.0, 2.0, 0.0}, 0.1}});
  task.movers = {test::moving_ball({1.0, 0.0, 0.0}, 0.1, {0.0, 1.0, 0.0}),
                 test::moving_ball({0.0, 1.0, 0.0}, 0.2, {2.0, 0.0, 0.0})};
  task.movers[1].prediction = scene::Prediction::speed_bound;
  task.movers[1].speed_max_m_s = 2.5;
  test::ReactiveScene scene(task);
  Movers movers(scene.planner_host(), scene.model);
  CHECK(movers.count() == 0);
  CHECK_FALSE(movers.contains(1));
  movers.update(2);
  REQUIRE(movers.count() == 2);
  CHECK_FALSE(movers.contains(0));  // the ball that stands
  CHECK(movers.contains(scene.mover_id(0)));
  CHECK(movers.contains(scene.mover_id(1)));
  Movers::Places places;
  movers.predict(0.4, places);
  CHECK(places[0].pose.p().isApprox(Vector3d(1.0, 0.4, 0.0)));
  CHECK(places[0].nearer == 0.0);
  CHECK(places[1].pose.p().isApprox(Vector3d(0.0, 1.0, 0.0)));
  CHECK(places[1].nearer == Approx(1.0));
  scene.set_time(0.5);
  movers.predict(0.4, places);
  CHECK(places[0].pose.p().isApprox(Vector3d(1.0, 0.9, 0.0)));
  movers.update(0);  // of a tick in which nothing moves
  CHECK(movers.count() == 0);
  CHECK_FALSE(movers.contains(scene.mover_id(0)));
}

TEST_CASE("an older host has no moving obstacles", "[reactive][movers]") {
  test::ReactiveScene scene(test::joint_task(VectorXd::Zero(4), {{{0.5, 0.0, 0.0}, 0.1}}));
  Movers movers(scene.planner_host(), scene.model);
  movers.update(3);
  CHECK(movers.count() == 0);
}

TEST_CASE("more moving obstacles than there is room for: the first ones count",
          "[reactive][movers]") {
  auto task = test::joint_task(VectorXd::Zero(4));
  for (std::size_t i = 0; i < Movers::max_count + 10; ++i)
    task.movers.push_back(
        test::moving_ball({0.0, 5.0 + static_cast<double>(i), 0.0}, 0.1, Vector3d::UnitX()));
  test::ReactiveScene scene(task);
  Movers movers(scene.planner_host(), scene.model);
  movers.update(task.movers.size());
  CHECK(movers.count() == Movers::max_count);
  CHECK(movers.contains(static_cast<int>(Movers::max_count) - 1));
  CHECK_FALSE(movers.contains(static_cast<int>(Movers::max_count)));
  Movers::Places places;
  movers.predict(0.0, places);
  CHECK(places[Movers::max_count - 1].pose.p().y() == 5.0 + Movers::max_count - 1);
}

TEST_CASE("clearance and the nearest point of each link are those of all pairs of shapes",
          "[reactive][movers][property]") {
  int near = 0, far = 0;
  for (std::uint64_t seed = 1; seed <= 400; ++seed) {
    CAPTURE(seed);
    Rng rng(seed);
    auto task = test::joint_task(VectorXd::Zero(4));
    if (seed % 2 == 0) task.robot = with_capsules();
    const std::size_t count = 1 + rng.below(4);
    for (std::size_t m = 0; m < count; ++m) task.movers.push_back(random_solid(rng));
    test::ReactiveScene scene(task);
    Movers movers(scene.planner_host(), scene.model);
    movers.update(count);
    const double ahead = rng.uniform(0.0, 0.5);
    Movers::Places places;
    movers.predict(ahead, places);

    dynamics::Workspace ws(scene.model);
    dynamics::forward_kinematics(scene.model, ws, test::random_numbers(rng, 4, 2.0));
    scene::PlacedShapes placed(scene.model);
    placed.place(scene.model, ws);
    const scene::Shapes arm = placed.view();

    // By brute force: the smallest distance of each link from each obstacle.
    constexpr double radius = 0.3;
    Eigen::MatrixXd least = Eigen::MatrixXd::Constant(4, static_cast<Eigen::Index>(count), 1e9);
    for (std::size_t m = 0; m < count; ++m) {
      const auto at = scene::placed_at(task.movers[m], {0.0, ahead});
      for (std::size_t i = 0; i < arm.size(); ++i) {
        double& smallest = least(scene.model.shapes()[i].link, static_cast<Eigen::Index>(m));
        smallest = std::min(smallest, distance(arm, i, task.movers[m], at));
      }
    }
    const double expected = std::min(least.minCoeff(), radius);
    REQUIRE(movers.clearance(arm, places, radius) == Approx(expected).margin(1e-10));
    int found = 0;
    movers.each_near(arm, places, radius, [&](const MoverPoint& point) {
      ++found;
      const auto shape = static_cast<std::size_t>(point.shape),
                 mover = static_cast<std::size_t>(point.mover);
      const auto at = scene::placed_at(task.movers[mover], {0.0, ahead});
      REQUIRE(scene.model.shapes()[shape].link == point.link);
      REQUIRE(point.distance == Approx(least(point.link, point.mover)).margin(1e-10));
      REQUIRE(distance(arm, shape, task.movers[mover], at) == Approx(point.distance).margin(1e-10));
      REQUIRE(point.direction.norm() == Approx(1.0));
      // From the point on the axis, against the direction, lies the obstacle's surface.
      const Vector3d surface =
          point.axis_point - (point.distance + arm.radii[shape] + at.nearer_m) * point.direction;
      REQUIRE(std::abs(scene::closest_on(task.movers[mover], at.pose, surface).distance) < 1e-9);
    });
    REQUIRE(found == (least.array() <= radius).count());
    (expected < radius ? near : far)++;
  }
  CHECK(near > 100);
  CHECK(far > 5);
}

TEST_CASE("an obstacle has passed when it is nearest from the other side", "[reactive][movers]") {
  auto task = test::joint_task(VectorXd::Zero(4));
  task.movers = {test::moving_ball({0.525, 0.4, 0.0}, 0.1, {0.0, -2.0, 0.0})};
  // It crosses the arm at 0.2 s, at the centre of a sphere.
  test::ReactiveScene scene(task);
  Movers movers(scene.planner_host(), scene.model);
  movers.update(1);
  dynamics::Workspace ws(scene.model);
  dynamics::forward_kinematics(scene.model, ws, VectorXd::Zero(4));
  scene::PlacedShapes placed(scene.model);
  placed.place(scene.model, ws);
  Movers::Places now, then;
  movers.predict(0.0, now);
  for (const double ahead : {0.0, 0.1, 0.19, 0.21, 0.3, 0.4}) {
    CAPTURE(ahead);
    movers.predict(ahead, then);
    int points = 0;
    movers.each_near(placed.view(), then, 1.0, [&](const MoverPoint& point) {
      // Only the links next to the ball are nearest to it from straight above or below.
      if (std::abs(point.direction.y()) < 0.9) return;
      ++points;
      CHECK(movers.has_passed(point, now[0]) == (ahead > 0.2));
    });
    CHECK(points > 0);
  }
}

#include "hamelin/reactive/obstacles.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "hamelin/test/reactive_scene.hpp"
#include "hamelin/test/single_tick.hpp"

using namespace hamelin;
using Eigen::Vector3d;
using Eigen::VectorXd;
using reactive::NearPoint;
using reactive::Obstacles;

namespace {

/// The obstacles of a scene, updated with given contacts.
struct ObstacleFixture {
  explicit ObstacleFixture(const test::ReactiveScene& scene, double radius)
      : model(scene.model), ws(scene.model), obstacles(scene.setup, radius) {}
  void update(const VectorXd& q, std::span<const hamelin_contact> contacts,
              std::span<const hamelin_self_contact> self_contacts = {}) {
    dynamics::forward_kinematics(model, ws, q);
    obstacles.update(model, ws, contacts, self_contacts);
  }
  const model::Model& model;
  dynamics::Workspace ws;
  Obstacles obstacles;
};

std::vector<hamelin_contact> random_contacts(Rng& rng, std::size_t spheres, std::size_t count,
                                             double spread) {
  std::vector<hamelin_contact> contacts;
  for (std::size_t i = 0; i < count; ++i) {
    hamelin_contact contact{};
    contact.shape = static_cast<std::int32_t>(rng.below(spheres));
    contact.obstacle = static_cast<std::int32_t>(rng.below(3)) - 1;
    contact.distance_m = rng.uniform(-0.01, 0.3);
    Vector3d n = test::random_vector(rng);
    if (rng.uniform() < 0.7) n = Vector3d(1.0, 0.0, 0.0) + 0.4 * n;  // many have similar directions
    planning::VectorMap(contact.direction_world, 3) = n.normalized();
    planning::VectorMap(contact.arm_point_world_m, 3) = test::random_vector(rng, spread);
    contacts.push_back(contact);
  }
  return contacts;
}

bool covers(const NearPoint& point, const hamelin_contact& contact, int link) {
  return point.link == link && point.obstacle == contact.obstacle &&
         point.distance <= contact.distance_m &&
         (point.shape == contact.shape && point.distance == contact.distance_m
              ? true
              : point.direction.dot(planning::vec3(contact.direction_world)) > 0.95 &&
                    (point.arm_point - planning::vec3(contact.arm_point_world_m)).norm() < 0.04);
}

}  // namespace

TEST_CASE("each near contact is chosen, or a nearer and similar one of its link",
          "[reactive][obstacles]") {
  const test::ReactiveScene scene(test::joint_task(VectorXd::Zero(4)));
  const double radius = 0.15;
  ObstacleFixture chosen(scene, radius);
  int full = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    CAPTURE(seed);
    Rng rng(seed);
    const auto contacts =
        random_contacts(rng, scene.setup.shapes().size(), 10 + rng.below(140), 0.06);
    chosen.update(VectorXd::Zero(4), contacts);
    const auto points = chosen.obstacles.points();
    REQUIRE(points.size() <= Obstacles::max_points);
    double farthest = radius, least = radius;
    // If the capacity is used up, only contacts nearer than the last point are guaranteed.
    if (points.size() == Obstacles::max_points) farthest = points.back().distance, ++full;
    for (const auto& contact : contacts) {
      least = std::min(least, contact.distance_m);
      const int link = scene.setup.shapes()[static_cast<std::size_t>(contact.shape)].link;
      const auto covering =
          std::count_if(points.begin(), points.end(),
                        [&](const NearPoint& point) { return covers(point, contact, link); });
      if (contact.distance_m <= farthest)
        REQUIRE(covering >= 1);
      else if (contact.distance_m > radius)
        REQUIRE(std::none_of(points.begin(), points.end(), [&](const NearPoint& point) {
          return point.distance == contact.distance_m;
        }));
    }
    REQUIRE(chosen.obstacles.clearance() == least);
    for (std::size_t i = 1; i < points.size(); ++i)
      REQUIRE(points[i - 1].distance <= points[i].distance);
  }
  CHECK(full > 0);
  CHECK(full < 200);
}

TEST_CASE("no two chosen points are similar", "[reactive][obstacles]") {
  const test::ReactiveScene scene(test::joint_task(VectorXd::Zero(4)));
  ObstacleFixture chosen(scene, 0.15);
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    CAPTURE(seed);
    Rng rng(seed);
    chosen.update(VectorXd::Zero(4), random_contacts(rng, scene.setup.shapes().size(), 100, 0.03));
    const auto points = chosen.obstacles.points();
    for (std::size_t i = 0; i < points.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        REQUIRE_FALSE((points[i].link == points[j].link &&
                       points[i].obstacle == points[j].obstacle &&
                       points[i].direction.dot(points[j].direction) > 0.95 &&
                       (points[i].arm_point - points[j].arm_point).norm() < 0.04));
  }
}

TEST_CASE("an obstacle's row is the gradient of its distance", "[reactive][obstacles]") {
  Rng rng(3);
  for (int trial = 0; trial < 20; ++trial) {
    CAPTURE(trial);
    test::Task task = test::joint_task(VectorXd::Zero(6));
    task.robot = test::random_robot(static_cast<std::uint64_t>(trial) + 1, 6, 3);
    test::ReactiveScene scene(task);
    ObstacleFixture chosen(scene, 2.0);
    const VectorXd q = test::random_joints(rng, 6);
    const Vector3d from = test::random_vector(rng);
    const auto sphere = static_cast<std::size_t>(rng.below(6));
    const double radius = scene.setup.shapes()[sphere].radius_m;
    const Vector3d offset = scene.center(q, sphere) - from;
    hamelin_contact contact{};
    contact.shape = static_cast<std::int32_t>(sphere);
    contact.distance_m = offset.norm() - radius;
    planning::VectorMap(contact.direction_world, 3) = offset.normalized();
    planning::VectorMap(contact.arm_point_world_m, 3) =
        scene.center(q, sphere) - radius * offset.normalized();
    contact.obstacle_velocity_world_m_s[1] = 0.4;
    chosen.update(q, {&contact, 1});
    REQUIRE(chosen.obstacles.points().size() == (contact.distance_m <= 2.0 ? 1 : 0));
    for (const auto& point : chosen.obstacles.points()) {
      CHECK(point.obstacle_speed == Approx(0.4 * offset.normalized().y()));
      for (int k = 0; k < 6; ++k) {
        VectorXd up = q, down = q;
        up[k] += 1e-6, down[k] -= 1e-6;
        const double slope = ((scene.center(up, sphere) - from).norm() -
                              (scene.center(down, sphere) - from).norm()) /
                             2e-6;
        CHECK(point.row[k] == Approx(slope).margin(1e-8));
      }
    }
  }
}

TEST_CASE("a self contact's row is the gradient of the distance between two parts",
          "[reactive][obstacles]") {
  const bool base = GENERATE(false, true);
  CAPTURE(base);
  Rng rng(5);
  for (int trial = 0; trial < 20; ++trial) {
    CAPTURE(trial);
    test::Task task = test::joint_task(VectorXd::Zero(6));
    task.robot = test::random_robot(static_cast<std::uint64_t>(trial) + 100, 6, 3);
    test::ReactiveScene scene(task);
    ObstacleFixture chosen(scene, 0.15);
    const VectorXd q = test::random_joints(rng, 6);
    const std::size_t a = 2 + rng.below(4), b = rng.below(a);
    const Vector3d base_point = test::random_vector(rng);  // a point of the base
    const auto separation = [&](const VectorXd& at) -> Vector3d {
      return scene.center(at, a) - (base ? base_point : scene.center(at, b));
    };
    const Vector3d n = separation(q).normalized();
    const double radius_a = scene.setup.shapes()[a].radius_m;
    hamelin_self_contact contact{};
    contact.shape_a = static_cast<std::int32_t>(a);
    contact.shape_b = base ? HAMELIN_SHAPE_OF_BASE : static_cast<std::int32_t>(b);
    contact.distance_m = 0.05;  // near enough to be used; rows depend only on points and directions
    planning::VectorMap(contact.direction_world, 3) = n;
    planning::VectorMap(contact.point_a_world_m, 3) = scene.center(q, a) - radius_a * n;
    planning::VectorMap(contact.point_b_world_m, 3) =
        base ? base_point : Vector3d(scene.center(q, b) + scene.setup.shapes()[b].radius_m * n);
    chosen.update(q, {}, {&contact, 1});
    REQUIRE(chosen.obstacles.points().size() == 1);
    const auto& point = chosen.obstacles.points().front();
    CHECK(point.obstacle == NearPoint::self);
    CHECK(point.obstacle_speed == 0.0);
    CHECK(chosen.obstacles.clearance() == 0.05);
    for (int k = 0; k < 6; ++k) {
      VectorXd up = q, down = q;
      up[k] += 1e-6, down[k] -= 1e-6;
      CHECK(point.row[k] ==
            Approx((separation(up).norm() - separation(down).norm()) / 2e-6).margin(1e-8));
    }
  }
}

TEST_CASE("self contacts beyond their radius are ignored", "[reactive][obstacles]") {
  const test::ReactiveScene scene(test::joint_task(VectorXd::Zero(4)));
  ObstacleFixture chosen(scene, 0.15);
  hamelin_self_contact contact{};
  contact.shape_a = 19;
  contact.direction_world[0] = 1.0;
  contact.distance_m = Obstacles::self_radius_m + 1e-9;
  chosen.update(VectorXd::Zero(4), {}, {&contact, 1});
  CHECK(chosen.obstacles.points().empty());
  contact.distance_m = Obstacles::self_radius_m;
  chosen.update(VectorXd::Zero(4), {}, {&contact, 1});
  CHECK(chosen.obstacles.points().size() == 1);
}

TEST_CASE("self contacts may use up the whole capacity", "[reactive][obstacles]") {
  const test::ReactiveScene scene(test::joint_task(VectorXd::Zero(4)));
  ObstacleFixture chosen(scene, 0.15);
  hamelin_self_contact contact{};
  contact.shape_a = 19;
  contact.direction_world[0] = 1.0;
  contact.distance_m = 0.01;
  const std::vector<hamelin_self_contact> many(Obstacles::max_points, contact);
  hamelin_contact near{};
  near.distance_m = 0.001;
  near.direction_world[1] = 1.0;
  chosen.update(VectorXd::Zero(4), {&near, 1}, many);
  CHECK(chosen.obstacles.points().size() == Obstacles::max_points);
  CHECK(chosen.obstacles.clearance() == 0.001);
}

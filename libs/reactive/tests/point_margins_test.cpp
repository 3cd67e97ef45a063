#include "hamelin/reactive/point_margins.hpp"

#include <catch2/catch.hpp>

#include "hamelin/test/reactive_scene.hpp"

using namespace hamelin;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Eigen::VectorXd;
using reactive::NearPoint;
using reactive::PointMargins;

namespace {

NearPoint of_sphere(int sphere, double distance = 0.05) {
  NearPoint point;
  point.shape = sphere;
  point.distance = distance;
  return point;
}

double margin(const PointMargins& margins, NearPoint point, double weight) {
  margins.set({&point, 1}, weight);
  return point.margin;
}

NearPoint within_arm() {
  NearPoint point = of_sphere(0);
  point.obstacle = NearPoint::self;
  return point;
}

// An arm stretched along x, with a ball at the given clearance beside its last sphere.
test::Task beside_ball(double clearance) {
  return test::joint_task(VectorXd::Zero(4), {{{0.975, 0.125 + clearance, 0.0}, 0.1}});
}
constexpr int last_sphere = 19;

}  // namespace

TEST_CASE("margins shrink from the full one to that of the goal on the approach",
          "[reactive][margins]") {
  test::ReactiveScene scene(beside_ball(0.006));
  const auto& margins = scene.margins;
  CHECK(margin(margins, of_sphere(last_sphere), 1.0) == 0.01);
  CHECK(margin(margins, of_sphere(last_sphere), 0.0) == Approx(0.003));  // 6 mm − 3 mm
  double previous = 0.0;
  for (double weight = 0.0; weight <= 1.0; weight += 0.125) {
    const double value = margin(margins, of_sphere(last_sphere), weight);
    CHECK(value == Approx(0.003 + 0.007 * weight));
    CHECK(value > previous);
    previous = value;
  }
}

TEST_CASE("a sphere without near obstacles at the goal keeps its full margin there",
          "[reactive][margins]") {
  test::ReactiveScene scene(beside_ball(0.006));
  CHECK(margin(scene.margins, of_sphere(0), 0.0) == 0.01);
  CHECK_FALSE(scene.margins.tight_at_goal(of_sphere(0)));
  CHECK(scene.margins.tight_at_goal(of_sphere(last_sphere)));
}

TEST_CASE("margins keep the posture of a joint goal admissible", "[reactive][margins]") {
  const double clearance = GENERATE(0.0011, 0.002, 0.0039, 0.004, 0.0041, 0.012, 0.013, 0.014, 0.1);
  CAPTURE(clearance);
  test::ReactiveScene scene(beside_ball(clearance));
  dynamics::Workspace ws(scene.model);
  reactive::Obstacles obstacles(scene.setup, test::contact_radius);
  const VectorXd goal = VectorXd::Zero(4);
  dynamics::forward_kinematics(scene.model, ws, goal);
  scene.surroundings.query(goal, test::contact_radius, 0.1);
  obstacles.update(scene.model, ws, scene.surroundings.contacts(), {});
  REQUIRE(obstacles.clearance() == Approx(clearance));
  scene.margins.set(obstacles.points(), 0.0);
  REQUIRE_FALSE(obstacles.points().empty());
  for (const auto& point : obstacles.points()) {
    CHECK(point.margin <= point.distance);
    CHECK(point.margin >= 0.001);
    CHECK(point.margin <= 0.01);
  }
  // as large as possible
  CHECK(obstacles.points().front().margin == Approx(std::clamp(clearance - 0.003, 0.001, 0.01)));
}

TEST_CASE("a goal in contact has the smallest margin", "[reactive][margins]") {
  test::ReactiveScene scene(beside_ball(-0.02));
  CHECK(margin(scene.margins, of_sphere(last_sphere), 0.0) == 0.001);
}

TEST_CASE("at a tip goal the margin of all spheres is that of the goal", "[reactive][margins]") {
  test::ReactiveScene scene(test::tip_task({0.9, 0.0, 0.0}, {{{0.975, 0.2, 0.0}, 0.1}}));
  for (const int sphere : {0, last_sphere}) {
    CHECK(margin(scene.margins, of_sphere(sphere), 0.0) == 0.003);
    CHECK(margin(scene.margins, of_sphere(sphere), 1.0) == 0.01);
    CHECK_FALSE(scene.margins.tight_at_goal(of_sphere(sphere)));
  }
}

TEST_CASE("the margin between parts of the arm shrinks for a goal that is folded closer",
          "[reactive][margins]") {
  // Joints 2 and 3 bring link 4 close to link 1.
  auto task = test::joint_task(Vector4d(0.0, 2.0, 2.0, 0.0));
  task.self_collision = true;
  test::ReactiveScene scene(task);
  scene.surroundings.query(task.q_goal, 0.01, 1.0);
  double nearest = 1.0;
  for (const auto& contact : scene.surroundings.self_contacts())
    nearest = std::min(nearest, contact.distance_m);

  SECTION("at a sufficient distance it is the full margin") {
    REQUIRE(nearest > 0.008);
    CHECK(margin(scene.margins, within_arm(), 0.0) == 0.005);
    CHECK_FALSE(scene.margins.tight_at_goal(within_arm()));
  }
  SECTION("closer it depends on the goal, and is the full margin far from it") {
    // The third joint folds the last two links back on the first. Bisection finds the angle.
    double open = 2.0, closed = 3.0;
    VectorXd q = task.q_goal;
    for (int i = 0; i < 60; ++i) {
      q[2] = 0.5 * (open + closed);
      scene.surroundings.query(q, 0.01, 1.0);
      nearest = 1.0;
      for (const auto& contact : scene.surroundings.self_contacts())
        nearest = std::min(nearest, contact.distance_m);
      (nearest > 0.005 ? open : closed) = q[2];
    }
    REQUIRE(nearest == Approx(0.005));
    auto tight = test::joint_task(q);
    tight.self_collision = true;
    test::ReactiveScene folded(tight);
    CHECK(margin(folded.margins, within_arm(), 0.0) == Approx(0.002));
    CHECK(margin(folded.margins, within_arm(), 1.0) == 0.005);
    CHECK(folded.margins.tight_at_goal(within_arm()));
  }
}

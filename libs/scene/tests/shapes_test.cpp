#include "hamelin/scene/shapes.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "hamelin/core/numbers.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/test/robots.hpp"
#include "hamelin/test/scene_queries.hpp"

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using namespace hamelin;
using namespace hamelin::scene;

// The minimum of a convex function on [0, 1] by interval sections, independent of closest_on.
template <class F>
double least(F&& f) {
  double low = 0.0, high = 1.0;
  double best = std::min(f(0.0), f(1.0));
  for (int i = 0; i < 200; ++i) {
    const double a = low + (high - low) / 3.0, b = high - (high - low) / 3.0;
    const double fa = f(a), fb = f(b);
    best = std::min({best, fa, fb});
    (fa < fb ? high : low) = fa < fb ? b : a;
  }
  return best;
}

Matrix3d random_rotation(Rng& rng) {
  return Eigen::AngleAxisd(rng.uniform(0.0, 3.1), test::random_direction(rng)).toRotationMatrix();
}

Obstacle random_obstacle(Rng& rng, Shape shape) {
  Obstacle o;
  o.name = "o";
  o.shape = shape;
  o.radius_m = rng.uniform(0.05, 0.3);
  o.length_m = rng.uniform(0.05, 0.6);
  o.size_m = {rng.uniform(0.05, 0.5), rng.uniform(0.05, 0.5), rng.uniform(0.05, 0.5)};
  o.pose = geometry::SE3(random_rotation(rng), test::random_vector(rng, 0.5));
  return o;
}

/// Two links with a capsule and a sphere each, on a base with a capsule.
model::Robot two_links() {
  model::Robot robot = test::random_robot(5, 2);
  for (auto& link : robot.links) {
    link.segments.push_back({{0.0, -0.1, 0.0}, {0.0, 0.1, 0.05}, 0.03});
    link.segments.push_back({{0.0, -1.0, 0.0}, {0.0, 1.0, 0.0}, 0.0});  // a line
  }
  robot.base_segments.push_back({{0.0, 0.0, -0.2}, {0.0, 0.0, 0.2}, 0.05, "pedestal"});
  return robot;
}

}  // namespace

TEST_CASE("an obstacle's distance from a segment is the least distance of its points",
          "[scene][unit]") {
  Rng rng(3);
  for (const Shape shape : {Shape::sphere, Shape::box, Shape::cylinder, Shape::capsule})
    for (int i = 0; i < 2000; ++i) {
      const Obstacle o = random_obstacle(rng, shape);
      const Vector3d center = o.pose.p() + test::random_vector(rng, 0.2);
      const geometry::SE3 pose(o.pose.R(), center);
      const Vector3d a = center + test::random_vector(rng, 0.7);
      // some short, some along an axis of the obstacle, some through its centre
      Vector3d b = a + std::pow(10.0, rng.uniform(-9.0, 0.0)) * test::random_direction(rng);
      if (i % 4 == 1)
        b = a + rng.uniform(-1.0, 1.0) * o.pose.R().col(static_cast<Eigen::Index>(rng.below(3)));
      if (i % 4 == 2) b = 2.0 * center - a;
      CAPTURE(to_string(shape), i);
      const double expected =
          least([&](double t) { return closest_on(o, pose, a + t * (b - a)).distance; });
      const AxisPoint hit = closest_on(o, pose, a, b);
      // sections stop where rounding hides the slope, so the result may be slightly less
      REQUIRE(hit.distance <= expected + 1e-12);
      REQUIRE(hit.distance >= expected - 1e-9);
      // the axis point has that distance and lies on the segment
      CHECK(std::abs(closest_on(o, pose, hit.axis_point).distance - hit.distance) < 1e-12);
      const double t =
          (b - a).norm() > 0.0 ? (hit.axis_point - a).dot(b - a) / (b - a).squaredNorm() : 0.0;
      CHECK((t > -1e-6 && t < 1.0 + 1e-6));
      CHECK((a + t * (b - a) - hit.axis_point).norm() < 1e-12);
      CHECK((hit.point + hit.distance * hit.direction - hit.axis_point).norm() < 1e-12);
      CHECK(std::abs(hit.direction.norm() - 1.0) < 1e-12);
    }
}

TEST_CASE("two segments' nearest points are found, parallel, crossing and degenerate ones too",
          "[scene][unit]") {
  Rng rng(8);
  for (int i = 0; i < 4000; ++i) {
    const Vector3d c = test::random_vector(rng), h = test::random_vector(rng, 0.5);
    Vector3d d = test::random_vector(rng), g = test::random_vector(rng, 0.5);
    switch (i % 8) {
      case 1:
        g = rng.uniform(-2.0, 2.0) * h;  // parallel
        break;
      case 2:
        g = h + 1e-8 * test::random_direction(rng);  // nearly so
        break;
      case 3:
        g.setZero();
        break;
      case 4:
        d = c + rng.uniform(-1.0, 1.0) * h + rng.uniform(-1.0, 1.0) * g;  // they cross
        break;
      case 5:
        g = -h;
        d = c + rng.uniform(-3.0, 3.0) * h;  // on one line
        break;
      default:
        break;
    }
    CAPTURE(i);
    // the squared distance is convex in both: sections within sections
    const auto at = [&](double u, double w) { return (c + u * h - d - w * g).squaredNorm(); };
    const double expected = std::sqrt(least([&](double t) {
      const Vector3d p = c + (2.0 * t - 1.0) * h - d;
      const double w =
          g.squaredNorm() > 0.0 ? std::clamp(p.dot(g) / g.squaredNorm(), -1.0, 1.0) : 0.0;
      return at(2.0 * t - 1.0, w);
    }));
    const AxisPair on = nearest_on_axes(c, h, d, g);
    REQUIRE(std::abs(on.on_a) <= 1.0);
    REQUIRE(std::abs(on.on_b) <= 1.0);
    const double found = std::sqrt(at(on.on_a, on.on_b));
    REQUIRE(found <= expected + 1e-8);
    REQUIRE(found >= expected - 1e-7);  // sections find a zero only to the square root of rounding
  }
  const AxisPair points =
      nearest_on_axes(Vector3d::Zero(), Vector3d::Zero(), Vector3d::Ones(), Vector3d::Zero());
  CHECK(points.on_a == 0.0);
  CHECK(points.on_b == 0.0);
}

TEST_CASE("shapes are ordered by link, spheres first, and lines are not shapes", "[scene][unit]") {
  const model::Model model(two_links());
  REQUIRE(model.shapes().size() == 4);
  CHECK(model.has_capsules());
  CHECK(model.describe(model.shapes()[1]) == "capsule 0 of link 'link0'");
  CHECK(model.describe(model.shapes()[2]) == "sphere 0 of link 'link1'");
  dynamics::Workspace ws(model);
  PlacedShapes arm(model);
  const Eigen::Vector2d q(0.4, -0.9);
  dynamics::forward_kinematics(model, ws, q);
  arm.place(model, ws);
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& shape = model.shapes()[i];
    const auto& link = model.robot().links[static_cast<std::size_t>(shape.link)];
    CHECK(arm.view().is_capsule(i) == (i % 2 == 1));
    if (i % 2 == 0) {
      CHECK((arm.view().centers[i] -
             dynamics::point_position(model, ws, shape.link, link.spheres[0].center_m))
                .norm() < 1e-14);
      continue;
    }
    CHECK((arm.view().from(i) -
           dynamics::point_position(model, ws, shape.link, link.segments[0].from_m))
              .norm() < 1e-14);
    CHECK(
        (arm.view().to(i) - dynamics::point_position(model, ws, shape.link, link.segments[0].to_m))
            .norm() < 1e-14);
    CHECK(arm.view().radii[i] == 0.03);
  }
  // an arm of spheres has no axes
  CHECK(PlacedShapes(model::Model(test::random_robot(5, 2))).view().half_axes.empty());
}

TEST_CASE("a capsule is as near to obstacles as the nearest sphere along it", "[scene][unit]") {
  Rng rng(21);
  std::vector<Obstacle> obstacles{random_obstacle(rng, Shape::sphere),
                                  random_obstacle(rng, Shape::box),
                                  random_obstacle(rng, Shape::cylinder)};
  const Environment environment(std::nullopt, obstacles, geometry::SE3{}, 2.0, 1.0);
  Environment::Scratch scratch(environment, 1);
  std::vector<Contact> out(environment.contacts_max(1));
  for (int i = 0; i < 300; ++i) {
    const std::vector<Vector3d> center{test::random_vector(rng, 0.6)},
        half{test::random_vector(rng, 0.3)};
    const std::vector<double> radius{rng.uniform(0.01, 0.1)};
    const Shapes capsule{center, radius, half};
    double nearest = infinity;
    constexpr int parts = 400;
    for (int k = 0; k <= parts; ++k) {
      const Vector3d p = center[0] + (2.0 * k / parts - 1.0) * half[0];
      for (const Obstacle& o : obstacles)
        nearest = std::min(nearest, closest_on(o, o.pose, p).distance - radius[0]);
    }
    const double clearance = environment.clearance(capsule, 0.0, infinity);
    REQUIRE(clearance <= nearest + 1e-12);
    REQUIRE(clearance >= nearest - half[0].norm() / parts);
    const std::size_t count = environment.closest(capsule, 10.0, 0.0, scratch, out);
    REQUIRE(count >= 3);
    CHECK(out[0].distance == clearance);
    for (std::size_t k = 0; k < count; ++k) {
      const Contact& c = out[k];
      // the arm's point is on the capsule, at that distance from the obstacle's point along the
      // direction
      const Vector3d on_axis = c.arm_point + radius[0] * c.direction;
      const double t =
          std::clamp((on_axis - center[0]).dot(half[0]) / half[0].squaredNorm(), -1.0, 1.0);
      CHECK((center[0] + t * half[0] - on_axis).norm() < 1e-12);
      CHECK((c.obstacle_point + c.distance * c.direction - c.arm_point).norm() < 1e-12);
    }
    // a shift along the direction of its nearest contact increases the clearance by the length of
    // the shift
    const std::vector<Vector3d> moved{center[0] + 1e-6 * out[0].direction};
    if (out[0].distance > 0.0 && out[0].distance + 1e-4 < out[1].distance)
      CHECK(environment.clearance({moved, radius, half}, 0.0, infinity) - clearance ==
            Approx(1e-6).epsilon(1e-3));
  }
}

TEST_CASE("a capsule along a wall has contacts at both its ends", "[scene][unit]") {
  Obstacle wall;
  wall.name = "wall";
  wall.shape = Shape::box;
  wall.size_m = {2.0, 0.2, 2.0};
  const Environment environment(std::nullopt, {wall}, geometry::SE3{}, 2.0, 0.5);
  Environment::Scratch scratch(environment, 1);
  std::vector<Contact> out(environment.contacts_max(1));
  const std::vector<Vector3d> center{{0.0, 0.2, 0.0}}, half{{0.3, 0.01, 0.0}};
  const std::vector<double> radius{0.05};
  REQUIRE(environment.closest({center, radius, half}, 0.5, 0.0, scratch, out) == 2);
  CHECK(out[0].arm_point.isApprox(Vector3d(-0.3, 0.14, 0.0), 1e-12));
  CHECK(out[0].distance == Approx(0.04));
  CHECK(out[1].arm_point.isApprox(Vector3d(0.3, 0.16, 0.0), 1e-12));
  CHECK(out[1].direction.isApprox(Vector3d::UnitY(), 1e-12));
}

TEST_CASE("parts with capsules are as far apart as the nearest spheres along them",
          "[scene][self]") {
  model::Robot robot = two_links();
  for (auto& link : robot.links) link.spheres.clear();
  robot.links[1].segments[0].part = "tool";
  robot.self_collision_disabled = {{"link0", "tool"}};
  const model::Model model(std::move(robot));
  const SelfField field(model);
  REQUIRE(field.pairs().size() == 2);  // either link's capsule and the pedestal
  CHECK(field.describe(1) == "'tool' and 'pedestal'");
  dynamics::Workspace ws(model);
  PlacedShapes arm(model);
  Rng rng(2);
  std::vector<SelfContact> out(2);
  for (int i = 0; i < 200; ++i) {
    dynamics::forward_kinematics(model, ws, test::random_joints(rng, 2, 3.0));
    arm.place(model, ws);
    const Shapes shapes = arm.view();
    REQUIRE(field.closest(shapes, infinity, out) == 2);
    for (std::size_t k = 0; k < 2; ++k) {
      double expected = infinity;
      constexpr int parts = 200;
      for (int a = -parts; a <= parts; ++a)
        for (int b = -parts; b <= parts; b += parts / 20) {
          const Vector3d p = shapes.centers[k] + (1.0 * a / parts) * shapes.half_axes[k];
          // the pedestal is upright, so the nearest height is known
          const Vector3d on_pedestal{0.0, 0.0, std::clamp(p.z(), -0.2, 0.2)};
          expected = std::min(expected, (p - on_pedestal).norm() - 0.08);
        }
      CAPTURE(i, k);
      CHECK(out[k].distance == Approx(expected).margin(1e-3));
      CHECK(out[k].distance <= expected + 1e-12);
      CHECK(field.distance(k, shapes, infinity) == out[k].distance);
      CHECK(out[k].sphere_b == SelfContact::base);
      CHECK((out[k].point_b + out[k].distance * out[k].direction - out[k].point_a).norm() < 1e-12);
    }
  }
}

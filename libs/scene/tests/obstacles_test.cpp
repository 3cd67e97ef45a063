#include "hamelin/scene/obstacles.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/test/scene_queries.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::scene;
using Eigen::Vector3d;

Obstacle example(Shape shape, Rng& rng) {
  Obstacle o;
  o.shape = shape;
  o.radius_m = 0.11;
  o.length_m = 0.3;
  o.size_m = {0.2, 0.35, 0.1};
  o.pose = {
      Eigen::AngleAxisd(rng.uniform(0.0, 3.0), test::random_direction(rng)).toRotationMatrix(),
      Vector3d{rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0)}};
  return o;
}

// Points all over the surface, in the world, about `step` apart.
std::vector<Vector3d> surface(const Obstacle& o, double step) {
  std::vector<Vector3d> local;
  const auto grid = [&](double half_u, double half_v, const auto& add) {
    const int nu = 1 + static_cast<int>(2.0 * half_u / step),
              nv = 1 + static_cast<int>(2.0 * half_v / step);
    for (int i = 0; i <= nu; ++i)
      for (int j = 0; j <= nv; ++j)
        add(-half_u + 2.0 * half_u * i / nu, -half_v + 2.0 * half_v * j / nv);
  };
  const double turn = 2.0 * std::numbers::pi;
  if (o.shape == Shape::box) {
    const Vector3d h = 0.5 * o.size_m;
    for (const double side : {-1.0, 1.0}) {
      grid(h.x(), h.y(), [&](double u, double v) { local.emplace_back(u, v, side * h.z()); });
      grid(h.y(), h.z(), [&](double u, double v) { local.emplace_back(side * h.x(), u, v); });
      grid(h.z(), h.x(), [&](double u, double v) { local.emplace_back(v, side * h.y(), u); });
    }
  } else if (o.shape == Shape::sphere) {
    const int n = static_cast<int>(turn * o.radius_m / step);
    for (int i = 0; i <= n; ++i)
      for (int j = 0; j < n; ++j) {
        const double a = std::numbers::pi * i / n, b = turn * j / n;
        local.emplace_back(o.radius_m * Vector3d(std::sin(a) * std::cos(b),
                                                 std::sin(a) * std::sin(b), std::cos(a)));
      }
  } else if (o.shape == Shape::capsule) {
    const int n = static_cast<int>(turn * o.radius_m / step),
              m = static_cast<int>(o.length_m / step);
    for (int j = 0; j < n; ++j) {
      const Vector3d radial(std::cos(turn * j / n), std::sin(turn * j / n), 0.0);
      for (int i = 0; i <= m; ++i)
        local.emplace_back(o.radius_m * radial +
                           o.length_m * (static_cast<double>(i) / m - 0.5) * Vector3d::UnitZ());
      for (int i = 0; i <= n; ++i) {
        const double a = std::numbers::pi * i / n;
        local.emplace_back(o.radius_m * (std::sin(a) * radial + std::cos(a) * Vector3d::UnitZ()) +
                           (a < 0.5 * std::numbers::pi ? 0.5 : -0.5) * o.length_m *
                               Vector3d::UnitZ());
      }
    }
  } else {
    const int n = static_cast<int>(turn * o.radius_m / step),
              m = static_cast<int>(o.length_m / step), r = static_cast<int>(o.radius_m / step);
    for (int j = 0; j < n; ++j) {
      const Vector3d radial(std::cos(turn * j / n), std::sin(turn * j / n), 0.0);
      for (int i = 0; i <= m; ++i)
        local.emplace_back(o.radius_m * radial +
                           o.length_m * (static_cast<double>(i) / m - 0.5) * Vector3d::UnitZ());
      for (int i = 0; i <= r; ++i)
        for (const double side : {-0.5, 0.5})
          local.emplace_back(o.radius_m * i / r * radial + side * o.length_m * Vector3d::UnitZ());
    }
  }
  for (Vector3d& p : local) p = o.pose * p;
  return local;
}

bool contains(const Obstacle& o, const Vector3d& world) {
  const Vector3d p = o.pose.R().transpose() * (world - o.pose.p());
  switch (o.shape) {
    case Shape::sphere:
      return p.norm() < o.radius_m;
    case Shape::box:
      return (p.cwiseAbs().array() < 0.5 * o.size_m.array()).all();
    case Shape::cylinder:
      return std::hypot(p.x(), p.y()) < o.radius_m && std::abs(p.z()) < 0.5 * o.length_m;
    case Shape::capsule: {
      const double beyond = std::max(std::abs(p.z()) - 0.5 * o.length_m, 0.0);
      return std::hypot(p.x(), p.y(), beyond) < o.radius_m;
    }
    case Shape::frame:
      break;
  }
  return false;
}

}  // namespace

TEST_CASE("closest points of primitives agree with their sampled surfaces", "[scene][property]") {
  const auto shape = GENERATE(Shape::sphere, Shape::box, Shape::cylinder, Shape::capsule);
  CAPTURE(to_string(shape));
  Rng rng(17);
  const Obstacle o = example(shape, rng);
  const double step = 0.004;
  const auto samples = surface(o, step);
  int inside = 0;
  for (int i = 0; i < 300; ++i) {
    const Vector3d p = o.pose.p() + rng.uniform(0.0, 0.4) * test::random_direction(rng);
    const SurfacePoint hit = closest_on(o, o.pose, p);
    double sampled = std::numeric_limits<double>::infinity();
    for (const Vector3d& s : samples) sampled = std::min(sampled, (s - p).norm());
    CAPTURE(i);
    CHECK((hit.distance < 0.0) == contains(o, p));
    inside += hit.distance < 0.0 ? 1 : 0;
    // Samples lie on the surface, so none is nearer, and one is within a step of the nearest point.
    CHECK(std::abs(hit.distance) <= sampled + 1e-12);
    CHECK(std::abs(hit.distance) >= sampled - step);
    CHECK((p - hit.point - hit.distance * hit.direction).norm() < 1e-12);
    CHECK(hit.direction.norm() == Approx(1.0).epsilon(1e-12));
    CHECK(std::abs(closest_on(o, o.pose, hit.point).distance) < 1e-12);
  }
  CHECK(inside > 10);
}

TEST_CASE("the direction is the gradient of the distance", "[scene][property]") {
  const auto shape = GENERATE(Shape::sphere, Shape::box, Shape::cylinder, Shape::capsule);
  CAPTURE(to_string(shape));
  Rng rng(23);
  const Obstacle o = example(shape, rng);
  const double h = 1e-6;
  int checked = 0;
  for (int i = 0; i < 100; ++i) {
    const Vector3d p = o.pose.p() + rng.uniform(0.0, 0.4) * test::random_direction(rng);
    const SurfacePoint hit = closest_on(o, o.pose, p);
    Vector3d gradient;
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3d d = h * Vector3d::Unit(axis);
      gradient[axis] =
          (closest_on(o, o.pose, p + d).distance - closest_on(o, o.pose, p - d).distance) /
          (2.0 * h);
    }
    if (gradient.norm() < 1.0 - 1e-6) continue;  // at a ridge of the depth
    ++checked;
    CHECK((gradient - hit.direction).norm() < 1e-4);
  }
  CHECK(checked > 80);
}

TEST_CASE("centres and axes have a defined direction", "[scene][unit]") {
  Obstacle o;
  o.radius_m = 0.1;
  o.length_m = 1.0;
  CHECK(closest_on(o, o.pose, Vector3d::Zero()).distance == -0.1);
  CHECK(closest_on(o, o.pose, Vector3d::Zero()).direction == Vector3d::UnitZ());
  o.shape = Shape::cylinder;
  CHECK(closest_on(o, o.pose, Vector3d::Zero()).distance == -0.1);
  CHECK(closest_on(o, o.pose, Vector3d::Zero()).direction == Vector3d::UnitX());
}

TEST_CASE("a moving obstacle follows its sine and its velocity is the derivative",
          "[scene][unit]") {
  Obstacle o;
  o.radius_m = 0.06;
  o.pose = {Eigen::Matrix3d::Identity(), {0.5, 0.0, 0.5}};
  CHECK(motion_at(o, 3.0).pose.p() == o.pose.p());
  CHECK(motion_at(o, 3.0).velocity == Vector3d::Zero());
  o.motion = SineMotion{{0.25, 0.0, -0.1}, 6.0};
  CHECK((motion_at(o, 1.5).pose.p() - Vector3d(0.75, 0.0, 0.4)).norm() < 1e-15);
  CHECK((motion_at(o, 6.0).pose.p() - o.pose.p()).norm() < 1e-15);
  for (const double t : {0.0, 0.7, 2.0, 5.9}) {
    const double h = 1e-5;
    const Vector3d numeric =
        (motion_at(o, t + h).pose.p() - motion_at(o, t - h).pose.p()) / (2.0 * h);
    CHECK((motion_at(o, t).velocity - numeric).norm() < 1e-9);
  }
}

TEST_CASE("an obstacle on a line moves in its time span, at its speed", "[scene][unit]") {
  Obstacle o;
  o.radius_m = 0.06;
  o.pose = {Eigen::Matrix3d::Identity(), {0.5, 0.0, 0.5}};
  o.motion = LinearMotion{{0.2, -0.1, 0.0}, 1.0, 2.0};
  CHECK(motion_at(o, 0.5).pose.p() == o.pose.p());
  CHECK(motion_at(o, 0.5).velocity == Vector3d::Zero());
  CHECK((motion_at(o, 2.0).pose.p() - Vector3d(0.7, -0.1, 0.5)).norm() < 1e-15);
  CHECK(motion_at(o, 2.0).velocity == Vector3d(0.2, -0.1, 0.0));
  CHECK((motion_at(o, 9.0).pose.p() - Vector3d(0.9, -0.2, 0.5)).norm() < 1e-15);
  CHECK(motion_at(o, 9.0).velocity == Vector3d::Zero());
  CHECK(max_speed(o) == Approx(std::sqrt(0.05)));
  o.motion = LinearMotion{{0.0, 0.0, 1.0}};
  CHECK((motion_at(o, 100.0).pose.p() - Vector3d(0.5, 0.0, 100.5)).norm() < 1e-12);
  o.motion = LinearMotion{{0.0, 0.0, 1.0}, 0.0, 0.0};
  CHECK_THROWS_WITH(check(o, "here"), Catch::Matchers::Contains("duration_s"));
}

TEST_CASE("what a planner sees depends on time and clearance", "[scene][unit]") {
  Obstacle o;
  o.radius_m = 0.1;
  o.appears_s = 2.0;
  CHECK_FALSE(visible(o, 1.9, 0.0));
  CHECK(visible(o, 2.0, 5.0));
  o.known = false;
  CHECK_FALSE(visible(o, 3.0, 0.0));
  o.visible_within_m = 0.15;
  CHECK(visible(o, 3.0, 0.15));
  CHECK_FALSE(visible(o, 3.0, 0.16));
  o.judge_only = true;
  CHECK_FALSE(visible(o, 3.0, 0.0));
}

TEST_CASE("sizes out of range are refused by name", "[scene][unit]") {
  Obstacle o;
  o.shape = Shape::cylinder;
  o.radius_m = 0.1;
  CHECK_THROWS_WITH(check(o, "here"),
                    Catch::Matchers::StartsWith("here: ") && Catch::Matchers::Contains("length_m"));
  o.shape = Shape::box;
  CHECK_THROWS_WITH(check(o, "here"), Catch::Matchers::Contains("size_m"));
  o.shape = Shape::sphere;
  CHECK_NOTHROW(check(o, "here"));
  o.motion = SineMotion{{1.0, 0.0, 0.0}, 0.0};
  CHECK_THROWS_WITH(check(o, "here"), Catch::Matchers::Contains("period_s"));
}

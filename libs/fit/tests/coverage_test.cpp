#include "hamelin/fit/coverage.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "meshes.hpp"

using namespace hamelin;
using namespace hamelin::fit;
using Eigen::Vector3d;

namespace {

Mesh cube() {
  return test::boxes({{Vector3d(-0.1, -0.1, -0.1), Vector3d(0.1, 0.1, 0.1)}});
}

Shape ball(const Vector3d& center, double radius) {
  return {center, center, radius};
}

}  // namespace

TEST_CASE("the gap of a cube in a ball is corner minus radius, bounded from both sides",
          "[fit][unit]") {
  const double corner = 0.1 * std::sqrt(3.0);
  for (const double radius : {0.05, 0.1, 0.12, 0.17}) {
    CAPTURE(radius);
    const std::vector<Shape> shapes{ball(Vector3d::Zero(), radius)};
    const Gap gap = coverage_gap(cube(), shapes, 1e-5);
    CHECK(gap.found_m == Approx(corner - radius).epsilon(1e-12));
    CHECK(gap.bound_m >= gap.found_m);
    CHECK(gap.bound_m <= gap.found_m + 1e-5);
    CHECK(gap.point.cwiseAbs().isApprox(Vector3d(0.1, 0.1, 0.1)));
  }
  const std::vector<Shape> enough{ball(Vector3d::Zero(), corner + 1e-12)};
  CHECK(coverage_gap(cube(), enough, 1e-5).bound_m == 0.0);
}

TEST_CASE("a gap in the middle of a face, away from all corners, is found", "[fit][unit]") {
  // eight balls about the corners, just too small to meet at the middles of the faces
  std::vector<Shape> shapes;
  const double radius = 0.1 * std::sqrt(2.0) - 0.004;
  for (int i = 0; i < 8; ++i)
    shapes.push_back(ball(
        {(i & 1) != 0 ? 0.1 : -0.1, (i & 2) != 0 ? 0.1 : -0.1, (i & 4) != 0 ? 0.1 : -0.1}, radius));
  const Gap gap = coverage_gap(cube(), shapes, 1e-5);
  CHECK(gap.found_m <= 0.004 + 1e-12);
  CHECK(gap.bound_m >= 0.004 - 1e-12);
  CHECK(gap.bound_m - gap.found_m <= 1e-5);
}

TEST_CASE("no shapes at all leave everything uncovered", "[fit][unit]") {
  CHECK(std::isinf(coverage_gap(cube(), {}, 1e-4).bound_m));
}

TEST_CASE("radii are raised until the gap is zero, by no more than a piece beyond the need",
          "[fit][unit]") {
  std::vector<Shape> shapes{ball({-0.05, 0.0, 0.0}, 0.01),
                            {{0.05, -0.05, 0.0}, {0.05, 0.05, 0.0}, 0.01}};
  const auto raised = close_gaps(cube(), {}, shapes, 2.5e-4);
  CHECK_FALSE(raised.empty());
  CHECK(coverage_gap(cube(), shapes, 1e-4).bound_m == 0.0);
  for (const Vector3d& p : test::random_points(cube(), 20'000, 5))
    REQUIRE(std::min(distance(shapes[0], p), distance(shapes[1], p)) <= 0.0);
  // no radius is larger than covering the cube alone would need
  CHECK(shapes[0].radius_m <= std::hypot(0.15, 0.1, 0.1) + 2.5e-4);
  CHECK(shapes[1].radius_m <= std::hypot(0.15, 0.05, 0.1) + 2.5e-4);
}

TEST_CASE("excess of a ball about a cube is radius minus half side, its volume that of the ball",
          "[fit][unit]") {
  const Solid solid(cube());
  const double radius = 0.1 * std::sqrt(3.0);
  const std::vector<Shape> shapes{ball(Vector3d::Zero(), radius)};
  const Excess out = excess(&solid, {}, shapes);
  CHECK(out.max_m == Approx(radius - 0.1).margin(2e-4));
  CHECK(out.mean_m > 0.0);
  CHECK(out.mean_m < out.max_m);
  CHECK(out.area_m2 == Approx(4.0 * M_PI * radius * radius));
  CHECK(out.volume_m3 == Approx(4.0 / 3.0 * M_PI * radius * radius * radius).epsilon(0.01));
}

TEST_CASE("a ball inside another does not count; a ball that is the geometry has no excess",
          "[fit][unit]") {
  const std::vector<Shape> geometry{ball({0.1, 0.0, 0.0}, 0.2)};
  const std::vector<Shape> shapes{geometry[0], ball({0.1, 0.0, 0.0}, 0.1)};
  const Excess out = excess(nullptr, geometry, shapes);
  CHECK(out.max_m == Approx(0.0).margin(1e-12));
  CHECK(out.area_m2 == Approx(4.0 * M_PI * 0.04));
  CHECK(out.volume_m3 == Approx(4.0 / 3.0 * M_PI * 0.008).epsilon(0.01));
}

TEST_CASE("points on a capsule lie on it and are spread evenly", "[fit][unit]") {
  const Shape capsule{{0.1, -0.2, 0.3}, {0.4, 0.1, 0.0}, 0.07};
  const double length = (capsule.to - capsule.from).norm();
  const SurfacePoints surface = surface_points(capsule, 4000);
  Vector3d center = Vector3d::Zero();
  for (const Vector3d& p : surface.points) {
    REQUIRE(distance(capsule, p) == Approx(0.0).margin(1e-12));
    center += p / 4000.0;
  }
  CHECK((center - 0.5 * (capsule.from + capsule.to)).norm() < 1e-3);
  CHECK(4000.0 * surface.area_each_m2 ==
        Approx(2.0 * M_PI * 0.07 * length + 4.0 * M_PI * 0.07 * 0.07));
}

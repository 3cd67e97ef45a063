#include "hamelin/fit/cover.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/fit/coverage.hpp"
#include "meshes.hpp"

using namespace hamelin;
using namespace hamelin::fit;
using Eigen::Vector3d;

namespace {

struct Case {
  const char* name;
  Mesh mesh;
};

std::vector<Case> cases() {
  return {
      {"box", test::boxes({{Vector3d(0.0, 0.0, 0.0), Vector3d(0.3, 0.1, 0.08)}})},
      {"cylinder", test::tube(0.05, 0.4, 48, true)},
      {"open tube", test::tube(0.05, 0.4, 48, false)},
      {"L", test::l_shape()},
      {"ball", test::ball(0.1, 16)},
      {"thin plate", test::boxes({{Vector3d(0.0, 0.0, 0.0), Vector3d(0.2, 0.15, 0.001)}})},
      {"two that overlap", test::boxes({{Vector3d(0.0, 0.0, 0.0), Vector3d(0.2, 0.1, 0.1)},
                                        {Vector3d(0.1, -0.05, 0.02), Vector3d(0.15, 0.2, 0.08)}})}};
}

double least_distance(const std::vector<Shape>& shapes, const Vector3d& p) {
  double least = 1e300;
  for (const Shape& shape : shapes) least = std::min(least, distance(shape, p));
  return least;
}

}  // namespace

TEST_CASE("covers contain every random point of the surface and stick out no farther than allowed",
          "[fit][property]") {
  for (const bool capsules : {false, true})
    for (const Case& c : cases()) {
      CAPTURE(c.name, capsules);
      const Solid solid(c.mesh, 30'000);
      CoverOptions options;
      options.capsules = capsules;
      options.excess_m = 0.025;
      const Cover found = cover(solid, {}, options);
      for (const Vector3d& p : test::random_points(c.mesh, 5000, 7))
        REQUIRE(least_distance(found.shapes, p) <= 0.0);
      CHECK(coverage_gap(c.mesh, found.shapes, 1e-4).bound_m == 0.0);
      // a grid step for the grid's resolution, 1 mm for radii raised by the proof
      const double most = excess(&solid, {}, found.shapes).max_m;
      if (solid.closed()) CHECK(most <= options.excess_m + 1e-3 + solid.spacing());
      CHECK(found.shapes.size() <= 24);
      for (const Shape& shape : found.shapes)
        for (const double x : {shape.from.x(), shape.to.z(), shape.radius_m})
          CHECK(std::abs(x * 1e5 - std::round(x * 1e5)) < 1e-6);
    }
}

TEST_CASE("a cube that one ball may cover gets one ball, and several for a smaller excess",
          "[fit][unit]") {
  const Mesh cube = test::boxes({{Vector3d(0.9, -0.1, -0.1), Vector3d(1.1, 0.1, 0.1)}});
  const Solid solid(cube);
  CoverOptions options;
  options.excess_m = 0.1 * (std::sqrt(3.0) - 1.0) + 1e-3;
  const Cover one = cover(solid, {}, options);
  REQUIRE(one.shapes.size() == 1);
  CHECK((one.shapes[0].from - Vector3d(1.0, 0.0, 0.0)).norm() < 2e-3);
  CHECK(one.shapes[0].radius_m == Approx(0.1 * std::sqrt(3.0)).margin(2e-3));
  options.excess_m = 0.03;
  const Cover more = cover(solid, {}, options);
  CHECK(more.shapes.size() > 4);
  options.count_max = 3;
  const Cover few = cover(solid, {}, options);
  CHECK(few.shapes.size() <= 3);
  CHECK(few.excess_bound_m > 0.03);
  CHECK(coverage_gap(cube, few.shapes, 1e-4).bound_m == 0.0);
}

TEST_CASE("a capsule's own shape is covered by one capsule, where balls need several",
          "[fit][unit]") {
  const Mesh rod = test::tube(0.04, 0.5, 64, true);
  const Solid solid(rod);
  CoverOptions options;
  options.excess_m = 0.02;
  const Cover balls = cover(solid, {}, options);
  options.capsules = true;
  const Cover capsules = cover(solid, {}, options);
  CHECK(capsules.shapes.size() == 1);
  CHECK(balls.shapes.size() >= 5);
  const Shape& rod_shape = capsules.shapes[0];
  CHECK(std::abs((rod_shape.to - rod_shape.from).normalized().z()) > 0.99);
}

TEST_CASE("geometry inside a given ball needs no cover", "[fit][unit]") {
  const Mesh box = test::boxes({{Vector3d(-0.1, -0.02, -0.02), Vector3d(0.1, 0.02, 0.02)}});
  const Solid solid(box);
  const std::vector<Shape> whole{{Vector3d::Zero(), Vector3d::Zero(), 0.2}};
  CHECK(cover(solid, whole, {}).shapes.empty());
  std::vector<Shape> half{{Vector3d(-0.1, 0.0, 0.0), Vector3d(-0.1, 0.0, 0.0), 0.1}};
  const Cover rest = cover(solid, half, {});
  for (const Shape& shape : rest.shapes) CHECK(shape.from.x() > 0.0);
  half.insert(half.end(), rest.shapes.begin(), rest.shapes.end());
  CHECK(coverage_gap(box, half, 1e-4).bound_m == 0.0);
}

TEST_CASE("the same mesh gives the same cover", "[fit][unit]") {
  const Solid solid(test::l_shape());
  for (const bool capsules : {false, true}) {
    CoverOptions options;
    options.capsules = capsules;
    const Cover a = cover(solid, {}, options), b = cover(solid, {}, options);
    REQUIRE(a.shapes.size() == b.shapes.size());
    for (std::size_t i = 0; i < a.shapes.size(); ++i) {
      CHECK(a.shapes[i].from == b.shapes[i].from);
      CHECK(a.shapes[i].to == b.shapes[i].to);
      CHECK(a.shapes[i].radius_m == b.shapes[i].radius_m);
    }
  }
}

TEST_CASE("a hundred thousand triangles are fitted", "[fit][unit]") {
  const Mesh fine = test::ball(0.15, 160);  // 102,400 triangles
  REQUIRE(fine.triangles.size() > 100'000);
  const Cover found = cover(Solid(fine), {}, {});
  REQUIRE(found.shapes.size() == 1);
  CHECK(found.shapes[0].radius_m == Approx(0.15).margin(2e-3));
}

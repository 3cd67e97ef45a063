#include "hamelin/fit/solid.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/core/error.hpp"
#include "meshes.hpp"

using namespace hamelin;
using namespace hamelin::fit;
using Eigen::Vector3d;

namespace {

// Signed distance of a box [closed form].
double box_distance(const Vector3d& p, const Vector3d& low, const Vector3d& high) {
  const Vector3d out = (low - p).cwiseMax(p - high);
  return out.cwiseMax(0.0).norm() + std::min(0.0, out.maxCoeff());
}

}  // namespace

TEST_CASE("signed distances of a box equal the closed form, and the grid's depth is close to it",
          "[fit][unit]") {
  const Vector3d low(-0.1, 0.0, 0.05), high(0.2, 0.1, 0.4);
  const Solid solid(test::boxes({{low, high}}));
  CHECK(solid.closed());
  CHECK(solid.area() == Approx(2.0 * (0.3 * 0.1 + 0.1 * 0.35 + 0.35 * 0.3)));
  CHECK(solid.volume() == Approx(0.3 * 0.1 * 0.35).epsilon(0.02));
  Rng rng(3);
  for (int i = 0; i < 5000; ++i) {
    const Vector3d p(rng.uniform(-0.2, 0.3), rng.uniform(-0.1, 0.2), rng.uniform(-0.05, 0.5));
    const double d = box_distance(p, low, high);
    CAPTURE(p.transpose(), d);
    REQUIRE(solid.signed_distance(p) == Approx(d).margin(1e-12));
    if (d < 0.0) REQUIRE(std::abs(solid.depth(p) + d) < solid.spacing());
  }
}

TEST_CASE("walls that are not visible from outside do not count", "[fit][unit]") {
  // two boxes that overlap, and a box inside the whole: the solid is the long box
  const Vector3d low(0.0, 0.0, 0.0), high(0.3, 0.1, 0.1);
  const Solid solid(test::boxes({{low, Vector3d(0.2, 0.1, 0.1)},
                                 {Vector3d(0.1, 0.0, 0.0), high},
                                 {Vector3d(0.12, 0.02, 0.02), Vector3d(0.28, 0.08, 0.08)}}));
  Rng rng(4);
  for (int i = 0; i < 2000; ++i) {
    const Vector3d p(rng.uniform(0.0, 0.3), rng.uniform(0.0, 0.1), rng.uniform(0.0, 0.1));
    const double d = box_distance(p, low, high);
    CAPTURE(p.transpose(), d);
    // the pieces of hidden walls that reach the surface are up to two grid steps long
    REQUIRE(solid.signed_distance(p) <= 0.0);
    REQUIRE(std::abs(solid.signed_distance(p) - d) < 3.0 * solid.spacing());
  }
  CHECK(solid.signed_distance({0.15, 0.05, 0.05}) == Approx(-0.05).margin(2.0 * solid.spacing()));
  CHECK(solid.volume() == Approx(0.003).epsilon(0.05));
}

TEST_CASE("an open tube has an inside", "[fit][unit]") {
  const Solid open(test::tube(0.05, 0.4, 48, false)), closed(test::tube(0.05, 0.4, 48, true));
  CHECK_FALSE(open.closed());
  CHECK(closed.closed());
  CHECK(open.signed_distance({0.01, 0.0, 0.2}) < -0.03);
  CHECK(open.signed_distance({0.07, 0.0, 0.2}) > 0.015);
  CHECK(open.signed_distance({0.0, 0.0, 0.5}) > 0.09);
  CHECK(open.volume() == Approx(closed.volume()).epsilon(0.1));
}

TEST_CASE("a mesh of degenerate triangles only is refused; among others they have no effect",
          "[fit][unit]") {
  Mesh flat;
  flat.vertices = {{0.0, 0.0, 0.0}, {0.1, 0.0, 0.0}, {0.2, 0.0, 0.0}};
  flat.triangles = {{0, 1, 2}, {0, 0, 1}};
  CHECK_THROWS_AS(Solid(flat), Error);
  Mesh with_degenerate = test::boxes({{Vector3d(0.0, 0.0, 0.0), Vector3d(0.1, 0.1, 0.1)}});
  with_degenerate.triangles.push_back({0, 0, 1});
  with_degenerate.triangles.push_back({2, 2, 2});
  CHECK(Solid(with_degenerate).signed_distance({0.05, 0.05, 0.05}) == Approx(-0.05));
}

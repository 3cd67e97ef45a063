#include "../src/way.hpp"

#include <algorithm>
#include <catch2/catch.hpp>

#include "hamelin/core/rng.hpp"

using Eigen::Vector2d;
using Eigen::VectorXd;
using hamelin::Rng;
using hamelin::hybrid::Way;

namespace {

// Right, up, left: 1 + 2 + 3 long.
Way hook(Eigen::Index room = 8) {
  Way way(2, room);
  way.add(Vector2d(0.0, 0.0));
  way.add(Vector2d(1.0, 0.0));
  way.add(Vector2d(1.0, 2.0));
  way.add(Vector2d(-2.0, 2.0));
  return way;
}

VectorXd at(const Way& way, double s) {
  VectorXd q(2);
  way.at(s, q);
  return q;
}

// Not inlined: GCC 12 otherwise takes the growth that cannot be for an overflow.
[[gnu::noinline]] void keep(Way& way, Eigen::Index n) {
  way.keep(n);
}

// The way's own points, and those between them, are where they should be.
void check_points(const Way& way, const std::vector<Vector2d>& expected) {
  REQUIRE(way.size() == static_cast<Eigen::Index>(expected.size()));
  double s = 0.0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    CHECK(way.point(k).isApprox(expected[i], 1e-15));
    if (i > 0) s += (expected[i] - expected[i - 1]).norm();
    CHECK((at(way, s) - expected[i]).norm() < 1e-12);
  }
  CHECK(way.length() == Approx(s).margin(1e-15));
}

}  // namespace

TEST_CASE("a way is measured by its length from the start", "[hybrid][way]") {
  const Way way = hook();
  CHECK(way.length() == 6.0);
  CHECK(at(way, -1.0) == Vector2d(0.0, 0.0));
  CHECK(at(way, 0.0) == Vector2d(0.0, 0.0));
  CHECK(at(way, 0.5) == Vector2d(0.5, 0.0));
  CHECK(at(way, 1.0) == Vector2d(1.0, 0.0));
  CHECK(at(way, 2.5) == Vector2d(1.0, 1.5));
  CHECK(at(way, 4.5) == Vector2d(-0.5, 2.0));
  CHECK(at(way, 6.0) == Vector2d(-2.0, 2.0));
  CHECK(at(way, 99.0) == Vector2d(-2.0, 2.0));
  CHECK(way.end() == Vector2d(-2.0, 2.0));
}

TEST_CASE("a point twice in a way does no harm", "[hybrid][way]") {
  Way way(2, 8);
  way.add(Vector2d(0.0, 0.0));
  way.add(Vector2d(0.0, 0.0));
  way.add(Vector2d(1.0, 0.0));
  way.add(Vector2d(1.0, 0.0));
  CHECK(way.length() == 1.0);
  CHECK(at(way, 0.0) == Vector2d(0.0, 0.0));
  CHECK(at(way, 0.25) == Vector2d(0.25, 0.0));
  CHECK(at(way, 1.0) == Vector2d(1.0, 0.0));
}

TEST_CASE("a way takes no more points than it has room for", "[hybrid][way]") {
  Way way = hook(4);
  way.add(Vector2d(9.0, 9.0));
  CHECK(way.size() == 4);
  CHECK(way.length() == 6.0);
  CHECK(way.end() == Vector2d(-2.0, 2.0));
}

TEST_CASE("keeping the first points shortens a way to them", "[hybrid][way]") {
  Way way = hook();
  keep(way, 9);
  CHECK(way.size() == 4);
  keep(way, 2);
  check_points(way, {{0.0, 0.0}, {1.0, 0.0}});
  way.add(Vector2d(1.0, 1.0));
  check_points(way, {{0.0, 0.0}, {1.0, 0.0}, {1.0, 1.0}});
  keep(way, 0);
  CHECK(way.empty());
  CHECK(way.length() == 0.0);
}

TEST_CASE("a reversed way runs from the end to the start", "[hybrid][way]") {
  Way way = hook();
  way.reverse();
  check_points(way, {{-2.0, 2.0}, {1.0, 2.0}, {1.0, 0.0}, {0.0, 0.0}});
  way.add(Vector2d(0.0, 3.0));
  way.reverse();
  check_points(way, {{0.0, 3.0}, {0.0, 0.0}, {1.0, 0.0}, {1.0, 2.0}, {-2.0, 2.0}});
}

TEST_CASE("the carrot runs ahead on the way and never back", "[hybrid][way]") {
  const Way way = hook();
  VectorXd q(2), carrot(2);
  q << 0.0, 0.0;
  const double s = way.carrot(0.0, q, 0.5, carrot);
  CHECK(s >= 0.5 - 1e-12);
  CHECK(s <= 0.52 + 1e-12);
  CHECK((carrot - at(way, s)).norm() == 0.0);
  CHECK((carrot - q).norm() >= 0.5 - 1e-12);

  SECTION("it stays while it is far enough ahead") {
    CHECK(way.carrot(2.0, q, 0.5, carrot) == 2.0);
  }
  SECTION("it ends at the end") {
    q << -2.0, 2.0;
    CHECK(way.carrot(5.9, q, 0.5, carrot) == 6.0);
    CHECK(carrot == way.end());
    CHECK(way.carrot(6.0, q, 0.5, carrot) == 6.0);
  }
  SECTION("it goes along the way and does not take short cuts") {
    q << 0.5, 2.0;  // beside the last stretch, far from the first
    CHECK(way.carrot(0.0, q, 0.5, carrot) == 0.0);
  }
}

TEST_CASE("the nearest place of a way is looked for ahead only, and so far only", "[hybrid][way]") {
  const Way way = hook();
  VectorXd q(2), scratch(2);
  q << 1.2, 1.0;
  CHECK(way.nearest(0.0, 6.0, q, scratch) == Approx(2.0).margin(0.011));
  CHECK(way.nearest(2.5, 6.0, q, scratch) == Approx(2.5));
  CHECK(way.nearest(0.0, 1.5, q, scratch) == Approx(1.5).margin(0.021));
  CHECK(way.nearest(5.9, 6.0, q, scratch) == Approx(5.9));
}

TEST_CASE("a cut replaces what lies between by a line", "[hybrid][way]") {
  VectorXd from(2), to(2);
  SECTION("over a corner: one point goes, two come") {
    Way way = hook();
    way.cut(0.5, 2.0, from, to);
    check_points(way, {{0.0, 0.0}, {0.5, 0.0}, {1.0, 1.0}, {1.0, 2.0}, {-2.0, 2.0}});
  }
  SECTION("over both corners") {
    Way way = hook();
    way.cut(0.5, 4.0, from, to);
    check_points(way, {{0.0, 0.0}, {0.5, 0.0}, {0.0, 2.0}, {-2.0, 2.0}});
  }
  SECTION("within one line nothing is lost") {
    Way way = hook();
    way.cut(1.5, 2.5, from, to);
    check_points(way, {{0.0, 0.0}, {1.0, 0.0}, {1.0, 0.5}, {1.0, 1.5}, {1.0, 2.0}, {-2.0, 2.0}});
  }
  SECTION("from end to end") {
    Way way = hook();
    way.cut(0.0, 6.0, from, to);
    CHECK(at(way, 0.0) == Vector2d(0.0, 0.0));
    CHECK(way.end() == Vector2d(-2.0, 2.0));
    CHECK(way.length() == Approx(std::sqrt(8.0)));
  }
  SECTION("without room for its points nothing is done") {
    Way way = hook(4);
    way.cut(0.5, 2.0, from, to);
    check_points(way, {{0.0, 0.0}, {1.0, 0.0}, {1.0, 2.0}, {-2.0, 2.0}});
  }
}

TEST_CASE("cuts keep the ends and never lengthen a way", "[hybrid][way][property]") {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    CAPTURE(seed);
    Rng rng(seed);
    Way way(3, 40);
    const auto points = 2 + rng.below(12);
    for (std::uint64_t i = 0; i < points; ++i)
      way.add(Eigen::Vector3d(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0)));
    const VectorXd start = way.point(0), end = way.end();
    VectorXd from(3), to(3), q(3);
    for (int cut = 0; cut < 20; ++cut) {
      const double before = way.length();
      double a = rng.uniform(0.0, before), b = rng.uniform(0.0, before);
      if (a > b) std::swap(a, b);
      way.at(a, from);
      way.at(b, to);
      const double saved = b - a - (to - from).norm();
      const bool room = way.size() + 2 <= way.capacity();
      way.cut(a, b, from, to);
      REQUIRE(way.length() <= before + 1e-12);
      if (room) REQUIRE(way.length() == Approx(before - saved).margin(1e-12));
      REQUIRE(way.size() <= way.capacity());
      way.at(0.0, q);
      REQUIRE((q - start).norm() == 0.0);
      REQUIRE((way.end() - end).norm() == 0.0);
    }
  }
}

#include "../src/joint_path.hpp"

#include <algorithm>
#include <catch2/catch.hpp>

#include "hamelin/core/rng.hpp"

using Eigen::Vector2d;
using Eigen::VectorXd;
using hamelin::Rng;
using hamelin::hybrid::JointPath;

namespace {

// Right, up, left: lengths 1 + 2 + 3.
JointPath hook(Eigen::Index room = 8) {
  JointPath path(2, room);
  path.add(Vector2d(0.0, 0.0));
  path.add(Vector2d(1.0, 0.0));
  path.add(Vector2d(1.0, 2.0));
  path.add(Vector2d(-2.0, 2.0));
  return path;
}

VectorXd at(const JointPath& path, double s) {
  VectorXd q(2);
  path.at(s, q);
  return q;
}

// Not inlined: GCC 12 otherwise warns of an overflow in a growth that cannot happen.
[[gnu::noinline]] void keep(JointPath& path, Eigen::Index n) {
  path.keep(n);
}

// Checks the points of the path, also by their arc lengths.
void check_points(const JointPath& path, const std::vector<Vector2d>& expected) {
  REQUIRE(path.size() == static_cast<Eigen::Index>(expected.size()));
  double s = 0.0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    CHECK(path.point(k).isApprox(expected[i], 1e-15));
    if (i > 0) s += (expected[i] - expected[i - 1]).norm();
    CHECK((at(path, s) - expected[i]).norm() < 1e-12);
  }
  CHECK(path.length() == Approx(s).margin(1e-15));
}

}  // namespace

TEST_CASE("a path is parametrised by its arc length", "[hybrid][joint_path]") {
  const JointPath path = hook();
  CHECK(path.length() == 6.0);
  CHECK(at(path, -1.0) == Vector2d(0.0, 0.0));
  CHECK(at(path, 0.0) == Vector2d(0.0, 0.0));
  CHECK(at(path, 0.5) == Vector2d(0.5, 0.0));
  CHECK(at(path, 1.0) == Vector2d(1.0, 0.0));
  CHECK(at(path, 2.5) == Vector2d(1.0, 1.5));
  CHECK(at(path, 4.5) == Vector2d(-0.5, 2.0));
  CHECK(at(path, 6.0) == Vector2d(-2.0, 2.0));
  CHECK(at(path, 99.0) == Vector2d(-2.0, 2.0));
  CHECK(path.end() == Vector2d(-2.0, 2.0));
}

TEST_CASE("repeated points in a path are harmless", "[hybrid][joint_path]") {
  JointPath path(2, 8);
  path.add(Vector2d(0.0, 0.0));
  path.add(Vector2d(0.0, 0.0));
  path.add(Vector2d(1.0, 0.0));
  path.add(Vector2d(1.0, 0.0));
  CHECK(path.length() == 1.0);
  CHECK(at(path, 0.0) == Vector2d(0.0, 0.0));
  CHECK(at(path, 0.25) == Vector2d(0.25, 0.0));
  CHECK(at(path, 1.0) == Vector2d(1.0, 0.0));
}

TEST_CASE("a path accepts no more points than its capacity", "[hybrid][joint_path]") {
  JointPath path = hook(4);
  path.add(Vector2d(9.0, 9.0));
  CHECK(path.size() == 4);
  CHECK(path.length() == 6.0);
  CHECK(path.end() == Vector2d(-2.0, 2.0));
}

TEST_CASE("keeping the first points shortens a path", "[hybrid][joint_path]") {
  JointPath path = hook();
  keep(path, 9);
  CHECK(path.size() == 4);
  keep(path, 2);
  check_points(path, {{0.0, 0.0}, {1.0, 0.0}});
  path.add(Vector2d(1.0, 1.0));
  check_points(path, {{0.0, 0.0}, {1.0, 0.0}, {1.0, 1.0}});
  keep(path, 0);
  CHECK(path.empty());
  CHECK(path.length() == 0.0);
}

TEST_CASE("a reversed path runs from the end to the start", "[hybrid][joint_path]") {
  JointPath path = hook();
  path.reverse();
  check_points(path, {{-2.0, 2.0}, {1.0, 2.0}, {1.0, 0.0}, {0.0, 0.0}});
  path.add(Vector2d(0.0, 3.0));
  path.reverse();
  check_points(path, {{0.0, 3.0}, {0.0, 0.0}, {1.0, 0.0}, {1.0, 2.0}, {-2.0, 2.0}});
}

TEST_CASE("the carrot moves ahead on the path and never back", "[hybrid][joint_path]") {
  const JointPath path = hook();
  VectorXd q(2), carrot(2);
  q << 0.0, 0.0;
  const double s = path.carrot(0.0, q, 0.5, carrot);
  CHECK(s >= 0.5 - 1e-12);
  CHECK(s <= 0.52 + 1e-12);
  CHECK((carrot - at(path, s)).norm() == 0.0);
  CHECK((carrot - q).norm() >= 0.5 - 1e-12);

  SECTION("it stays in place while it is far enough ahead") {
    CHECK(path.carrot(2.0, q, 0.5, carrot) == 2.0);
  }
  SECTION("it stops at the end") {
    q << -2.0, 2.0;
    CHECK(path.carrot(5.9, q, 0.5, carrot) == 6.0);
    CHECK(carrot == path.end());
    CHECK(path.carrot(6.0, q, 0.5, carrot) == 6.0);
  }
  SECTION("it follows the path and takes no short cuts") {
    q << 0.5, 2.0;  // beside the last segment, far from the first
    CHECK(path.carrot(0.0, q, 0.5, carrot) == 0.0);
  }
}

TEST_CASE("the nearest place of a path is searched ahead only, and within the range only",
          "[hybrid][joint_path]") {
  const JointPath path = hook();
  VectorXd q(2), scratch(2);
  q << 1.2, 1.0;
  CHECK(path.nearest(0.0, 6.0, q, scratch) == Approx(2.0).margin(0.011));
  CHECK(path.nearest(2.5, 6.0, q, scratch) == Approx(2.5));
  CHECK(path.nearest(0.0, 1.5, q, scratch) == Approx(1.5).margin(0.021));
  CHECK(path.nearest(5.9, 6.0, q, scratch) == Approx(5.9));
}

TEST_CASE("a cut replaces a stretch by a straight line", "[hybrid][joint_path]") {
  VectorXd from(2), to(2);
  SECTION("over a corner: one point is replaced by two") {
    JointPath path = hook();
    path.cut(0.5, 2.0, from, to);
    check_points(path, {{0.0, 0.0}, {0.5, 0.0}, {1.0, 1.0}, {1.0, 2.0}, {-2.0, 2.0}});
  }
  SECTION("over both corners") {
    JointPath path = hook();
    path.cut(0.5, 4.0, from, to);
    check_points(path, {{0.0, 0.0}, {0.5, 0.0}, {0.0, 2.0}, {-2.0, 2.0}});
  }
  SECTION("within one segment no point is lost") {
    JointPath path = hook();
    path.cut(1.5, 2.5, from, to);
    check_points(path, {{0.0, 0.0}, {1.0, 0.0}, {1.0, 0.5}, {1.0, 1.5}, {1.0, 2.0}, {-2.0, 2.0}});
  }
  SECTION("from end to end") {
    JointPath path = hook();
    path.cut(0.0, 6.0, from, to);
    CHECK(at(path, 0.0) == Vector2d(0.0, 0.0));
    CHECK(path.end() == Vector2d(-2.0, 2.0));
    CHECK(path.length() == Approx(std::sqrt(8.0)));
  }
  SECTION("without capacity for its points the path stays unchanged") {
    JointPath path = hook(4);
    path.cut(0.5, 2.0, from, to);
    check_points(path, {{0.0, 0.0}, {1.0, 0.0}, {1.0, 2.0}, {-2.0, 2.0}});
  }
}

TEST_CASE("cuts keep the ends and never lengthen a path", "[hybrid][joint_path][property]") {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    CAPTURE(seed);
    Rng rng(seed);
    JointPath path(3, 40);
    const auto points = 2 + rng.below(12);
    for (std::uint64_t i = 0; i < points; ++i)
      path.add(
          Eigen::Vector3d(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0)));
    const VectorXd start = path.point(0), end = path.end();
    VectorXd from(3), to(3), q(3);
    for (int cut = 0; cut < 20; ++cut) {
      const double before = path.length();
      double a = rng.uniform(0.0, before), b = rng.uniform(0.0, before);
      if (a > b) std::swap(a, b);
      path.at(a, from);
      path.at(b, to);
      const double saved = b - a - (to - from).norm();
      const bool room = path.size() + 2 <= path.capacity();
      path.cut(a, b, from, to);
      REQUIRE(path.length() <= before + 1e-12);
      if (room) REQUIRE(path.length() == Approx(before - saved).margin(1e-12));
      REQUIRE(path.size() <= path.capacity());
      path.at(0.0, q);
      REQUIRE((q - start).norm() == 0.0);
      REQUIRE((path.end() - end).norm() == 0.0);
    }
  }
}

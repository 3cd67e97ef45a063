#include "hamelin/planning/trail.hpp"

#include <catch2/catch.hpp>

using Eigen::Vector2d;
using Eigen::VectorXd;
using hamelin::planning::Trail;

namespace {

constexpr double spacing = 0.04, reached = 0.1;

VectorXd at(double x, double y = 0.0) {
  return Vector2d(x, y);
}

/// A trail of points 0.05 apart along the first joint, the newest at 0.05 (count − 1).
Trail straight(int count, Eigen::Index capacity) {
  Trail trail(2, capacity, spacing);
  for (int i = 0; i < count; ++i) trail.add(at(0.05 * i));
  return trail;
}

}  // namespace

TEST_CASE("a trail keeps points that are far enough apart, and forgets the oldest", "[trail]") {
  Trail trail(2, 5, spacing);
  CHECK(trail.size() == 0);
  for (int i = 0; i <= 100; ++i) trail.add(at(0.0125 * i));  // every fourth is kept
  REQUIRE(trail.size() == 5);
  for (int age = 0; age < 5; ++age) {
    CAPTURE(age);
    CHECK(trail.point(age)[0] == Approx(1.25 - 0.05 * age));
    if (age > 0) CHECK((trail.point(age) - trail.point(age - 1)).norm() >= 0.04 - 1e-12);
  }
  trail.clear();
  CHECK(trail.size() == 0);
  trail.add(at(3.0));
  REQUIRE(trail.size() == 1);
  CHECK(trail.point(0) == at(3.0));
}

TEST_CASE("the way back along a trail skips points that are reached, but not the oldest",
          "[trail]") {
  const Trail trail = straight(10, 16);          // from 0 to 0.45
  CHECK(trail.next(0, at(0.46), reached) == 2);  // 0.45 and 0.40 are nearer than 0.1
  CHECK(trail.next(2, at(0.46), reached) == 2);
  CHECK(trail.next(2, at(0.36), reached) == 4);
  CHECK(trail.next(0, at(0.45, 1.0), reached) == 0);
  CHECK(trail.next(9, at(0.0), reached) == 9);
  CHECK(trail.next(7, at(0.02), reached) == 9);
}

TEST_CASE("a trail forgets its newest points, also across the end of its ring", "[trail]") {
  Trail trail = straight(12, 8);  // the ring has turned; 0.20 to 0.55 are left
  REQUIRE(trail.size() == 8);
  trail.forget(5);
  REQUIRE(trail.size() == 3);
  for (int age = 0; age < 3; ++age) CHECK(trail.point(age)[0] == Approx(0.30 - 0.05 * age));
  trail.forget(0);
  CHECK(trail.size() == 3);
  trail.add(at(1.0));
  REQUIRE(trail.size() == 4);
  CHECK(trail.point(0) == at(1.0));
  CHECK(trail.point(1)[0] == Approx(0.30));

  trail = straight(12, 8);
  trail.forget(7);
  REQUIRE(trail.size() == 1);
  trail.add(at(1.0));
  CHECK(trail.point(0) == at(1.0));
  CHECK(trail.point(1)[0] == Approx(0.20));
}

TEST_CASE("a copy of a trail has its newest points, and goes on as a trail", "[trail]") {
  const Trail trail = straight(12, 8);
  for (const Eigen::Index capacity : {3, 8, 20}) {
    CAPTURE(capacity);
    Trail copy(2, capacity, spacing);
    copy.add(at(7.0));
    copy.copy(trail);
    const Eigen::Index size = std::min<Eigen::Index>(capacity, 8);
    REQUIRE(copy.size() == size);
    for (Eigen::Index age = 0; age < size; ++age) CHECK(copy.point(age) == trail.point(age));
    copy.add(at(9.0));
    CHECK(copy.point(0) == at(9.0));
    CHECK(copy.point(1) == trail.point(0));
  }
}

#include "../src/evasion.hpp"

#include <catch2/catch.hpp>

using Eigen::Vector2d;
using Eigen::VectorXd;
using hamelin::hybrid::Act;
using hamelin::hybrid::Evasion;
using hamelin::hybrid::evasion_velocity;
using hamelin::hybrid::Trail;

namespace {

VectorXd at(double x, double y = 0.0) {
  return Vector2d(x, y);
}

/// A trail of points 0.05 apart along the first joint, the newest at 0.05 (count − 1).
Trail straight(int count, Eigen::Index capacity) {
  Trail trail(2, capacity);
  for (int i = 0; i < count; ++i) trail.add(at(0.05 * i));
  return trail;
}

}  // namespace

TEST_CASE("a trail keeps points that are far enough apart, and forgets the oldest", "[hybrid]") {
  Trail trail(2, 5);
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
          "[hybrid]") {
  const Trail trail = straight(10, 16);  // from 0 to 0.45
  CHECK(trail.next(0, at(0.46)) == 2);   // 0.45 and 0.40 are nearer than 0.1
  CHECK(trail.next(2, at(0.46)) == 2);
  CHECK(trail.next(2, at(0.36)) == 4);
  CHECK(trail.next(0, at(0.45, 1.0)) == 0);
  CHECK(trail.next(9, at(0.0)) == 9);
  CHECK(trail.next(7, at(0.02)) == 9);
}

TEST_CASE("a trail forgets its newest points, also across the end of its ring", "[hybrid]") {
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

TEST_CASE("a copy of a trail has its newest points, and goes on as a trail", "[hybrid]") {
  const Trail trail = straight(12, 8);
  for (const Eigen::Index capacity : {3, 8, 20}) {
    CAPTURE(capacity);
    Trail copy(2, capacity);
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

TEST_CASE("an evasion aside approaches its end at 2/s, slower near it", "[hybrid]") {
  // docs/theory.md (10.37)
  const Trail trail(2, 4);
  Evasion evasion(2);
  evasion.act = Act::aside;
  evasion.aside = Vector2d(0.6, 0.8);
  Eigen::Index age = 0;
  VectorXd u(2);
  evasion_velocity(evasion, trail, at(0.0), age, u);
  CHECK(u.isApprox(Vector2d(1.2, 1.6)));  // speed 2
  evasion_velocity(evasion, trail, at(0.54, 0.72), age, u);
  CHECK(u.isApprox(Vector2d(0.24, 0.32)));  // gain 4
  evasion_velocity(evasion, trail, evasion.aside, age, u);
  CHECK(u.isZero(0.0));
}

TEST_CASE("an evasion back follows the trail point by point and ends at its oldest", "[hybrid]") {
  const Trail trail = straight(10, 16);
  Evasion evasion(2);
  evasion.act = Act::back;
  Eigen::Index age = 0;
  VectorXd u(2);
  evasion_velocity(evasion, trail, at(0.46), age, u);
  CHECK(age == 2);
  CHECK(u.isApprox(Vector2d(-2.0, 0.0)));
  VectorXd q = at(0.45);
  for (int i = 0; i < 400; ++i) {
    evasion_velocity(evasion, trail, q, age, u);
    REQUIRE(u.norm() <= 2.0 + 1e-12);
    REQUIRE(u[0] <= 1e-12);
    q += 0.01 * u;
  }
  CHECK(age == 9);
  CHECK(q.norm() < 1e-4);
  evasion_velocity(evasion, trail, at(0.05), age, u);
  CHECK(u.isApprox(Vector2d(-0.2, 0.0)));  // gain 4 towards the oldest point
}

TEST_CASE("an arm without a trail, and one that stops, want to rest", "[hybrid]") {
  Evasion evasion(2);
  Eigen::Index age = 0;
  VectorXd u = at(1.0, 1.0);
  evasion.act = Act::back;
  evasion_velocity(evasion, Trail(2, 4), at(0.5), age, u);
  CHECK(u.isZero(0.0));
  u = at(1.0, 1.0);
  evasion.act = Act::stop;
  evasion_velocity(evasion, straight(5, 8), at(0.5), age, u);
  CHECK(u.isZero(0.0));
  CHECK(age == 0);
}

#include "../src/evasion.hpp"

#include <catch2/catch.hpp>

using Eigen::Vector2d;
using Eigen::VectorXd;
using hamelin::hybrid::Act;
using hamelin::hybrid::Evasion;
using hamelin::hybrid::evasion_velocity;
using hamelin::hybrid::Trail;
using hamelin::hybrid::trail_spacing;

namespace {

VectorXd at(double x, double y = 0.0) {
  return Vector2d(x, y);
}

/// A trail of points 0.05 apart along the first joint, the newest at 0.05 (count − 1).
Trail straight(int count, Eigen::Index capacity) {
  Trail trail(2, capacity, trail_spacing);
  for (int i = 0; i < count; ++i) trail.add(at(0.05 * i));
  return trail;
}

}  // namespace

TEST_CASE("an evasion aside approaches its end at 2/s, slower near it", "[hybrid]") {
  // docs/theory.md (10.37)
  const Trail trail(2, 4, trail_spacing);
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
  evasion_velocity(evasion, Trail(2, 4, trail_spacing), at(0.5), age, u);
  CHECK(u.isZero(0.0));
  u = at(1.0, 1.0);
  evasion.act = Act::stop;
  evasion_velocity(evasion, straight(5, 8), at(0.5), age, u);
  CHECK(u.isZero(0.0));
  CHECK(age == 0);
}

#include "hamelin/planning/joint_path.hpp"

#include <algorithm>
#include <catch2/catch.hpp>

#include "hamelin/core/rng.hpp"

using Eigen::Vector2d;
using Eigen::VectorXd;
using hamelin::Rng;
using hamelin::planning::JointPath;

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

}  // namespace

TEST_CASE("a path is parametrised by its arc length", "[planning][joint_path]") {
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

TEST_CASE("repeated points in a path are harmless", "[planning][joint_path]") {
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

TEST_CASE("a path accepts no more points than its capacity", "[planning][joint_path]") {
  JointPath path = hook(4);
  path.add(Vector2d(9.0, 9.0));
  CHECK(path.size() == 4);
  CHECK(path.length() == 6.0);
  CHECK(path.end() == Vector2d(-2.0, 2.0));
}

TEST_CASE("the carrot moves ahead on the path and never back", "[planning][joint_path]") {
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

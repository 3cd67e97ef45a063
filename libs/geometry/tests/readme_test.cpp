#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <numbers>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/test/readme.hpp"

using namespace hamelin;
using namespace hamelin::geometry;
using std::numbers::pi;

TEST_CASE("the README's example runs", "[geometry][docs]") {
  // clang-format off
  // [example]
// A rotation about z through (0.5, 0, 0).
const Vector6d screw = (Vector6d() << 0.0, 0.0, 1.0, 0.0, -0.5, 0.0).finished();
const SE3 g = SE3::exp(screw * (pi / 2.0));
const Eigen::Vector3d moved = g * Eigen::Vector3d(1.0, 0.0, 0.0);  // (0.5, 0.5, 0)
// In the moved frame the screw is the same, because exp(screw) commutes with it.
const Vector6d seen_from_body = g.inverse().Ad(screw);
const Vector6d wrench = (Vector6d() << 0.0, 0.0, 2.0, 0.0, 0.0, 0.0).finished();
const double power = wrench.dot(g.Ad(screw)), same = g.Ad_T(wrench).dot(screw);  // [W] at 1 rad/s
  // [example]
  // clang-format on
  CHECK((moved - Eigen::Vector3d(0.5, 0.5, 0.0)).norm() < 1e-15);
  CHECK((seen_from_body - screw).norm() < 1e-15);
  CHECK(power == Approx(2.0));
  CHECK(same == Approx(power));
  test::check_readme_example("libs/geometry");
}

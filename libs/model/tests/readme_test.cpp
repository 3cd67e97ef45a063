#include <catch2/catch.hpp>

#include "hamelin/model/make_chain.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/test/readme.hpp"

using namespace hamelin;

TEST_CASE("the README's example runs", "[model][docs]") {
  // clang-format off
  // [example]
// A chain of three links in a plane, standing on a table.
model::ChainOptions options;
options.links = 3;
options.axes = "x";
const model::Robot robot = model::make_chain(options);
const geometry::SE3 base(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.0, 0.0, 0.7));
const model::Model arm(robot, base);
REQUIRE(arm.planar());  // uses SE(2)
REQUIRE(arm.dof() == 3);
  // [example]
  // clang-format on
  test::check_readme_example("libs/model");
}

#include <catch2/catch.hpp>

#include "hamelin/model/make_chain.hpp"
#include "hamelin/search/search.hpp"
#include "hamelin/test/joint_space_world.hpp"
#include "hamelin/test/readme.hpp"

using namespace hamelin;

TEST_CASE("the README's example searches a path to a pose", "[search][unit]") {
  const geometry::SE3 grasp(Eigen::Matrix3d::Identity(), {0.2, 0.8, 0.5});
  test::JointSpaceWorld world({});
  // clang-format off
  // [example]
const model::Model arm(model::make_chain({}));  // seven links of 0.2 m
search::Search search(arm, {});  // 12 mm of clearance
search.begin({Eigen::VectorXd::Zero(7), {scene::pose_goal(grasp)}}, world);
while (!search.advance(100)) {  // so many checks, as a tick may have time for
}
const Eigen::MatrixXd& way_points = search.path().points;  // as columns, the last one at the goal
  // [example]
  // clang-format on
  CHECK(way_points.cols() >= 2);
  test::check_readme_example("libs/search");
}

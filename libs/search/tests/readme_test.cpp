#include <catch2/catch.hpp>

#include "hamelin/model/make_chain.hpp"
#include "hamelin/search/search.hpp"
#include "hamelin/test/readme.hpp"
#include "joint_space_world.hpp"

using namespace hamelin;

TEST_CASE("the README's example searches a path to a pose", "[guide][unit]") {
  if (search::available()) {
    const geometry::SE3 grasp(Eigen::Matrix3d::Identity(), {0.2, 0.8, 0.5});
    test::JointSpaceWorld world({});
    // clang-format off
  // [example]
const model::Model arm(model::make_chain({}));  // seven links of 0.2 m
const search::Guide guide(arm, {});  // RRT-Connect, 12 mm of clearance
const search::Path path = guide.search({Eigen::VectorXd::Zero(7), scene::pose_goal(grasp)}, world);
if (path.found()) {
  const Eigen::MatrixXd& way_points = path.points;  // as columns, the last one at the goal
  // [example]
      // clang-format on
      CHECK(way_points.cols() >= 2);
    }
    CHECK(path.found());
  }
  test::check_readme_example("libs/guide");
}

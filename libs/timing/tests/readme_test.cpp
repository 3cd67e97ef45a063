#include <catch2/catch.hpp>

#include "hamelin/model/make_chain.hpp"
#include "hamelin/test/joint_space_world.hpp"
#include "hamelin/test/readme.hpp"
#include "hamelin/timing/blended_path.hpp"
#include "hamelin/timing/time_law.hpp"

using namespace hamelin;

TEST_CASE("the README's example makes a motion of a path", "[timing][unit]") {
  const model::Model arm(model::make_chain({3}));
  const scene::Levers levers(arm, nullptr);
  const search::Margins margins(0.01);
  test::JointSpaceWorld world({});
  Eigen::MatrixXd points = Eigen::MatrixXd::Zero(3, 3);
  points(0, 1) = points(0, 2) = points(1, 2) = 1.0;
  timing::BlendedPath path(points);
  timing::Limits limits;
  limits.acceleration = Eigen::VectorXd::Constant(3, 5.0);
  scene::JointTrajectory trajectory;
  // clang-format off
  // [example]
timing::Blending(levers).widen(path, margins, world);  // path: a timing::BlendedPath
timing::TimedPath motion;
motion.curve = path.curve();
timing::TimeLaw law(arm, limits);
if (law.solve(motion)) trajectory = motion.sampled(0.004);
  // [example]
  // clang-format on
  CHECK_NOTHROW(scene::check(trajectory, "trajectory"));
  CHECK(trajectory.q.rightCols(1).isApprox(points.rightCols(1), 1e-9));
  test::check_readme_example("libs/timing");
}

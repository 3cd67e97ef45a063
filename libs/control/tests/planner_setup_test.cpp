#include "hamelin/control/planner_setup.hpp"

#include <catch2/catch.hpp>

#include "hamelin/control/preparation.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/model/make_chain.hpp"

using namespace hamelin;
using Eigen::Vector3d;

namespace {

model::Robot chain_of_three() {
  model::ChainOptions options;
  options.links = 3;
  return model::make_chain(options);
}

}  // namespace

TEST_CASE("limits that no joint of the robot states are absent, not infinite",
          "[control][limits]") {
  const scene::Scene scene;
  model::Robot robot = chain_of_three();
  const auto none = control::modelled_limits(scene, robot);
  CHECK(none.q_lower.size() == 0);
  CHECK(none.velocity_max.size() == 0);
  CHECK(none.effort_max.size() == 0);
  robot.links[1].joint.effort_max = 7.0;
  robot.links[2].joint.upper = 1.0;
  const auto some = control::modelled_limits(scene, robot);
  CHECK(some.effort_max == Vector3d(infinity, 7.0, infinity));
  CHECK(some.q_upper == Vector3d(infinity, infinity, 1.0));
  CHECK(some.q_lower == Vector3d::Constant(-infinity));
  CHECK(some.velocity_max.size() == 0);
  scene::Scene off = scene;
  off.model.torque_limits = false;
  CHECK(control::modelled_limits(off, robot).effort_max.size() == 0);
}

TEST_CASE("a planner is told infinite velocity limits of joints that have none",
          "[control][limits]") {
  scene::Scene scene;
  scene.name = "scene.json";
  scene.goals = {scene::joint_goal(Vector3d::Zero())};
  model::Robot robot = chain_of_three();
  robot.links[1].joint.velocity_max = 2.0;
  const model::Model arm(robot);
  control::World world(scene, arm, {});
  const control::WorldView view(scene, arm, world);
  control::LimitReserve reserve;
  reserve.velocity = Vector3d(infinity, 0.1, infinity);  // shares of the limits
  const auto setup = control::planner_setup(scene, arm, view, 0.001, reserve);
  CHECK(setup.velocity_max == Vector3d(infinity, 1.9, infinity));
}

// Controllers of arms among moving obstacles.
#include <array>
#include <catch2/catch.hpp>
#include <cmath>

#include "../loop.hpp"
#include "hamelin/test/allocations.hpp"

using namespace hamelin;
using Eigen::Vector3d;
using Eigen::VectorXd;
using test::Loop;

namespace {

/// An arm that stands at its goal, without a map.
scene::Scene at_its_goal() {
  scene::Scene scene = test::sampled("clutter.json");
  scene.map.reset();
  scene.obstacles.clear();
  scene.goals = {scene::joint_goal(scene.start_q)};
  return scene;
}

/// A sphere that is far at first, swings 0.15 m beyond the tip, and comes back.
scene::Obstacle swinging(const scene::Scene& scene, double period_s) {
  const model::Model arm = control::load_model(scene);
  dynamics::Workspace ws(arm);
  dynamics::forward_kinematics(arm, ws, scene.start_q);
  scene::Obstacle sphere;
  sphere.name = "pendulum";
  sphere.radius_m = 0.1;
  sphere.pose = {Eigen::Matrix3d::Identity(),
                 dynamics::tip_pose(arm, ws).p() + Vector3d(0.0, 0.6, 0.0)};
  sphere.motion = scene::SineMotion{{0.0, -0.75, 0.0}, period_s};
  return sphere;
}

}  // namespace

TEST_CASE("an arm that has reached its goal evades a sphere that swings through its posture",
          "[control][controller][hybrid][movers]") {
  const double period_s = GENERATE(3.0, 4.0, 6.0);
  CAPTURE(period_s);
  scene::Scene scene = at_its_goal();
  scene.obstacles = {swinging(scene, period_s)};
  Loop loop(scene);
  dynamics::Workspace ws(loop.arm);
  dynamics::forward_kinematics(loop.arm, ws, scene.start_q);
  scene::PlacedShapes at_goal(loop.arm);
  at_goal.place(loop.arm, ws);
  const scene::Environment alone(std::nullopt, scene.obstacles, scene.base, 2.0, 0.5);

  double clearance = 1.0, if_it_stood = 1.0, farthest = 0.0;
  long allocations = 0;
  std::array<double, 3> nearest_to_goal{1.0, 1.0, 1.0};
  const long ticks = std::lround(3000.0 * period_s) - 1;
  for (long k = 0; k < ticks; ++k) {
    const control::Answer* answer = nullptr;
    const long made = test::allocations_in([&] { answer = &loop.tick(); });
    if (k > 0) allocations += made;  // the first tick of a planner may prepare
    INFO(answer->cause);
    REQUIRE(answer->state == control::ControlState::reached);
    clearance = std::min(clearance, loop.controller.view().clearance_m());
    if_it_stood = std::min(if_it_stood, alone.clearance(at_goal.view(), loop.state.time_s, 1.0));
    const double error = (loop.state.q - scene.start_q).lpNorm<Eigen::Infinity>();
    farthest = std::max(farthest, error);
    // The sphere is away from the arm in the second half of each period.
    const auto period = static_cast<std::size_t>(loop.state.time_s / period_s);
    if (loop.state.time_s > (static_cast<double>(period) + 0.5) * period_s)
      nearest_to_goal[period] = std::min(nearest_to_goal[period], error);
    loop.step(answer->torque);
  }
  CHECK(if_it_stood < -0.05);
  CHECK(clearance > 0.0);
  CHECK(farthest > 0.05);
  for (const double error : nearest_to_goal) CHECK(error < scene.goals[0].tolerance_rad);
  if (test::counts_allocations()) CHECK(allocations == 0);
}

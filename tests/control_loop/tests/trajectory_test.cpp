#include <catch2/catch.hpp>
#include <cmath>

#include "../loop.hpp"
#include "hamelin/test/allocations.hpp"

using namespace hamelin;
using Eigen::VectorXd;
using test::Loop;
using test::refusal;
using test::sampled;

namespace {

// From the start by `swing` at the joint and back, in four seconds, with a pause in between.
scene::JointTrajectory swing(const scene::Scene& scene, int joint, double swing) {
  scene::JointTrajectory out;
  out.time_s = VectorXd::Zero(4);
  out.time_s << 0.0, 1.5, 2.5, 4.0;
  out.q = scene.start_q.replicate(1, 4);
  out.q(joint, 1) += swing;
  out.q(joint, 2) += swing;
  out.v = out.a = Eigen::MatrixXd::Zero(out.q.rows(), 4);
  return out;
}

scene::Scene free_scene() {
  scene::Scene scene = sampled("pillar.json");
  scene.obstacles.clear();
  return scene;
}

}  // namespace

TEST_CASE("an arm follows a trajectory in time, through a pause, without allocating",
          "[control][trajectory]") {
  scene::Scene scene = free_scene();
  const scene::JointTrajectory trajectory = swing(scene, 0, 1.0);
  scene.goals = {scene::trajectory_goal(trajectory)};
  Loop loop(scene);
  VectorXd q(7), v(7), a(7);
  control::ControlState state = control::ControlState::running;
  double error = 0.0;
  long allocations = 0, k = 0;
  for (; k < 6000 && state == control::ControlState::running; ++k) {
    trajectory.at(loop.state.time_s, q, v, a);
    error = std::max(error, (loop.state.q - q).lpNorm<Eigen::Infinity>());
    const control::Answer* answer = nullptr;
    const long made = test::allocations_in([&] { answer = &loop.tick(); });
    if (k > 0) allocations += made;
    state = answer->state;
    if (state == control::ControlState::running) {
      REQUIRE(answer->reference != nullptr);
      CHECK(answer->reference->rate == 1.0);
    }
    loop.step(answer->torque);
  }
  CHECK(state == control::ControlState::reached);
  CHECK(k == Approx(4001).margin(2));  // not at once, although it starts where it ends
  CHECK(error < 2e-3);
  if (test::counts_allocations()) CHECK(allocations == 0);
}

TEST_CASE("a trajectory that is proved is followed on its path, and one that is not says why",
          "[control][trajectory]") {
  scene::Scene scene = free_scene();
  scene.safety.type = scene::SafetyType::shield;
  std::string log;
  control::Controller::Options options;
  options.log = [&](std::int32_t, std::string_view line) { (log += line) += '\n'; };
  scene::JointTrajectory trajectory = swing(scene, 0, 0.8);
  scene.goals = {scene::trajectory_goal(trajectory)};
  Loop loop(scene, options);
  for (int k = 0; k < 1000; ++k) {
    const control::Answer& answer = loop.tick();
    REQUIRE(answer.reference != nullptr);
    CHECK(answer.reference->certified);
    CHECK(loop.controller.shield_report()->along_path);
    loop.step(answer.torque);
  }
  CHECK_THAT(log, !Catch::Contains("the trajectory is"));

  const auto answer_to = [&](const scene::JointTrajectory& other) {
    log.clear();
    loop.controller.set_goal(scene::trajectory_goal(other));
    return log;
  };
  trajectory.v(0, 0) = 0.1;
  CHECK(answer_to(trajectory) ==
        "goal 1: the trajectory is followed without a proof: it begins or ends in motion\n");
  trajectory.v(0, 0) = 0.0;
  trajectory.time_s *= 0.3;
  CHECK_THAT(answer_to(trajectory),
             Catch::StartsWith("goal 1: the trajectory is followed more slowly: within the limits "
                               "it takes "));
  loop.controller.world().set_obstacle(
      scene::read_scene(test::data_folder / "scenes/pillar.json").obstacles[0]);
  trajectory = swing(scene, 0, 1.6);
  CHECK_THAT(answer_to(trajectory),
             Catch::StartsWith(
                 "goal 1: the trajectory is followed without a proof: it is not proved to be clear "
                 "at 0."));
}

TEST_CASE("a stop goes on along its trajectory while goals are replaced again and again",
          "[control][trajectory]") {
  scene::Scene scene = free_scene();
  scene.safety.type = scene::SafetyType::shield;
  scene.goals = {scene::trajectory_goal(swing(scene, 0, 0.8))};
  Loop loop(scene);
  for (int k = 0; k < 700; ++k) loop.step(loop.tick().torque);
  loop.controller.stop("test");
  for (int k = 0; k < 1000; ++k) {
    if (k % 10 == 0)
      loop.controller.set_goal(scene::trajectory_goal(swing(scene, 0, 0.4 + 1e-4 * k)));
    loop.step(loop.tick().torque);
    CHECK(loop.controller.shield_report()->along_path);
  }
  CHECK(loop.controller.shield_report()->at_rest);
  CHECK(loop.state.v.norm() < 1e-3);
}

TEST_CASE("an obstacle that appears in the way holds a trajectory up, and the arm goes around it",
          "[control][trajectory]") {
  scene::Scene scene = free_scene();
  scene::JointTrajectory trajectory = swing(scene, 0, 1.6);
  trajectory.time_s.conservativeResize(2);
  for (auto* x : {&trajectory.q, &trajectory.v, &trajectory.a}) x->conservativeResize(7, 2);
  scene.goals = {scene::trajectory_goal(trajectory)};
  Loop loop(scene);
  double slowest = 1.0;
  control::ControlState state = control::ControlState::running;
  for (long k = 0; k < 40000 && state == control::ControlState::running; ++k) {
    if (k == 200) {
      scene::Obstacle pillar =
          scene::read_scene(test::data_folder / "scenes/pillar.json").obstacles[0];
      loop.controller.world().set_obstacle(pillar);
    }
    const control::Answer& answer = loop.tick();
    state = answer.state;
    if (answer.reference != nullptr) slowest = std::min(slowest, answer.reference->rate);
    loop.step(answer.torque);
    if (k > 0) CHECK(loop.controller.verdict()->certified);
  }
  CHECK(slowest < 0.1);
  CHECK(state == control::ControlState::reached);
}

TEST_CASE("a trajectory replaces other goals, and wrong ones are refused",
          "[control][trajectory]") {
  const scene::Scene scene = free_scene();
  Loop loop(scene);
  for (int k = 0; k < 10; ++k) loop.step(loop.tick().torque);
  CHECK(loop.controller.answer().reference == nullptr);
  scene::JointTrajectory trajectory = swing(scene, 0, 0.4);
  for (const auto& link : loop.arm.robot().links) trajectory.joints.push_back(link.joint.name);
  CHECK(loop.controller.set_goal(scene::trajectory_goal(trajectory)) == 1);
  loop.step(loop.tick().torque);
  CHECK(loop.controller.answer().reference != nullptr);

  const auto refused = [&](const scene::JointTrajectory& wrong) {
    return refusal([&] { loop.controller.set_goal(scene::trajectory_goal(wrong)); });
  };
  scene::JointTrajectory other = trajectory;
  std::swap(other.joints[0], other.joints[1]);
  CHECK_THAT(refused(other), Catch::StartsWith("goal 1: trajectory: joint 1 is '"));
  other = trajectory;
  other.joints.clear();
  for (auto* x : {&other.q, &other.v, &other.a}) x->conservativeResize(6, 4);
  CHECK_THAT(refused(other), Catch::StartsWith("goal 1: q: 6 values given, expected 7"));
  scene::Goal inconsistent = scene::trajectory_goal(trajectory);
  inconsistent.path(0, 1) += 0.1;
  CHECK(refusal([&] { loop.controller.set_goal(inconsistent); }) ==
        "goal 1: path: differs from the trajectory, expected its points");
}

TEST_CASE("planners that do not follow trajectories refuse them", "[control][trajectory]") {
  scene::Scene scene = free_scene();
  scene.planner = scene::Choice{"apf", Json::object()};
  Loop loop(scene);
  const scene::Goal goal = scene::trajectory_goal(swing(scene, 0, 0.4));
  CHECK(refusal([&] { loop.controller.set_goal(goal); }) ==
        "goal 1: trajectory: the planner does not follow trajectories, expected one that does, "
        "such as hybrid");
  scene.goals = {goal};
  CHECK_THAT(refusal([&] { const Loop other(scene); }),
             Catch::Contains("/goals/0: is a trajectory, which planner 'apf' does not follow"));
}

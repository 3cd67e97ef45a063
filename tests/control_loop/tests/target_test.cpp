// Targets that move while a controller follows them.
#include <atomic>
#include <catch2/catch.hpp>
#include <thread>

#include "../loop.hpp"
#include "hamelin/control/hamelin_control.h"
#include "hamelin/test/allocations.hpp"

using namespace hamelin;
using Eigen::Vector3d;
using test::Loop;
using test::refusal;
using test::sampled;

namespace {

scene::Scene following() {
  scene::Scene scene = sampled("follow.json");
  scene.goals = {scene::follow_goal()};
  return scene;
}

}  // namespace

TEST_CASE("a target that is streamed to a controller is followed, without allocating",
          "[control][controller]") {
  Loop loop(following());
  control::Controller& controller = loop.controller;
  CHECK(loop.tick().target->waiting);
  const geometry::SE3 from = controller.tip();
  const auto target_at = [&](double time_s) {
    return Vector3d(from.p() + Vector3d(0.0, 0.1 * time_s, 0.05 * time_s));
  };
  long allocations = 0;
  for (int k = 0; k < 2000; ++k) {
    const double now = loop.state.time_s;
    if (k % 16 == 0) controller.set_target(control::TargetPose{now, {from.R(), target_at(now)}});
    const control::Answer* answer = nullptr;
    allocations += test::allocations_in([&] { answer = &loop.tick(); });
    loop.step(answer->torque);
    CHECK(answer->state == control::ControlState::running);
  }
  CHECK(allocations == 0);
  CHECK_FALSE(controller.answer().target->lost);
  CHECK((controller.tip().p() - target_at(loop.state.time_s)).norm() < 0.002);
  // The stream ends: the arm comes to rest where the target does.
  for (int k = 0; k < 1500; ++k) loop.step(loop.tick().torque);
  CHECK(controller.answer().target->lost);
  CHECK((controller.tip().p() - controller.answer().target->pose.p()).norm() < 1e-3);
  // joints go on slowly towards the middle of their limits
  CHECK(loop.v.lpNorm<Eigen::Infinity>() < 0.01);
}

TEST_CASE("a joystick moves the tip, in turn with goals", "[control][controller]") {
  Loop loop(following());
  control::Controller& controller = loop.controller;
  const auto push = [&](const Vector3d& v, int ticks) {
    for (int k = 0; k < ticks; ++k) {
      controller.set_target(control::TargetTwist{loop.state.time_s + 0.0005, v});
      loop.step(loop.tick().torque);
    }
  };
  loop.step(loop.tick().torque);
  const geometry::SE3 from = controller.tip();
  push({0.1, 0.0, 0.0}, 1000);
  push(Vector3d::Zero(), 500);
  CHECK((controller.tip().p() - from.p() - Vector3d(0.1, 0.0, 0.0)).norm() < 0.003);

  const std::uint64_t home = controller.set_goal(scene::joint_goal(loop.state.q));
  CHECK(refusal([&] { controller.set_target(control::TargetTwist{9.0}); }) ==
        "target: no goal follows a streamed target, expected a follow goal");
  loop.step(loop.tick().torque);
  CHECK(controller.answer().goals_number == home);
  CHECK(controller.answer().target == nullptr);
  controller.set_goal(scene::follow_goal());  // its times begin again, and the arm waits
  loop.step(loop.tick().torque);
  CHECK(controller.answer().target->waiting);
  CHECK((controller.answer().target->pose.p() - controller.tip().p()).norm() < 1e-12);
  push({0.0, 0.1, 0.0}, 500);
  CHECK(controller.answer().target != nullptr);
  CHECK((controller.tip().p() - from.p() - Vector3d(0.1, 0.05, 0.0)).norm() < 0.01);
}

TEST_CASE("wrong targets are refused, and nothing changes", "[control][controller]") {
  Loop loop(following());
  control::Controller& controller = loop.controller;
  loop.step(loop.tick().torque);
  const geometry::SE3 at = controller.tip();
  controller.set_target(control::TargetPose{0.0, at});
  CHECK(refusal([&] {
          controller.set_target(control::TargetPose{0.0, at});
        }) == "target: time_s is 0, expected a time after that of the last one, 0");
  (void)loop.tick();
  CHECK(controller.answer().target->pose.p().isApprox(at.p()));

  scene::Goal goal = scene::follow_goal();
  goal.stream.gap_max_s = 0.0;
  CHECK(refusal([&] { controller.set_goal(goal); }) ==
        "goal 1: gap_max_s: 0 is not allowed, expected more than 0");
  CHECK(refusal([&] {
          controller.set_goals({scene::follow_goal(), scene::joint_goal(loop.state.q)});
        }) == "goal 1: follow: is never reached, expected it as the last goal");
}

TEST_CASE("planners that do not follow targets refuse such goals", "[control][controller]") {
  scene::Scene scene = following();
  scene.planner->name = "template";
  CHECK_THAT(refusal([&] { Loop loop(scene); }),
             Catch::Contains("/goals/0: follows a target, which planner 'template' does not "
                             "support, expected one that does, such as hybrid"));
  scene.goals = {scene::joint_goal(scene.start_q)};
  Loop loop(scene);
  CHECK(refusal([&] { loop.controller.set_goal(scene::follow_goal()); }) ==
        "goal 1: follow: the planner does not follow targets, expected one that does, such as "
        "hybrid");
}

TEST_CASE("targets come from another thread while the arm follows", "[control][controller]") {
  Loop loop(following());
  (void)loop.tick();
  const geometry::SE3 from = loop.controller.tip();
  std::atomic<double> time_s{0.0};
  std::atomic<bool> stop{false};
  std::thread writer([&] {
    for (double last = -1.0; !stop.load();) {
      const double now = time_s.load();
      if (now <= last) continue;
      last = now;
      loop.controller.set_target(
          control::TargetPose{now, {from.R(), from.p() + Vector3d(0.0, 0.1 * now, 0.0)}});
    }
  });
  for (int k = 0; k < 1000; ++k) {
    loop.step(loop.tick().torque);
    time_s = loop.state.time_s;
  }
  stop = true;
  writer.join();
  // How far the arm is behind depends on the threads; a target that rests is reached in any case.
  const control::TargetState& target = *loop.controller.answer().target;
  REQUIRE(target.pose.p().allFinite());
  const geometry::SE3 rest = target.pose;
  for (int k = 0; k < 1500; ++k) {
    if (k % 20 == 19) loop.controller.set_target(control::TargetPose{loop.state.time_s, rest});
    loop.step(loop.tick().torque);
  }
  CHECK((loop.controller.tip().p() - rest.p()).norm() < 0.005);
}

TEST_CASE("the C interface follows poses and twists", "[control][c]") {
  char error[256] = "";
  const std::string scene_file = (test::data_folder / "scenes" / "shelf.json").string();
  const char* const directories[] = {HAMELIN_TEST_PLUGIN_DIR};
  hamelin_controller_options options{};
  options.struct_size = sizeof options;
  options.scene_file = scene_file.c_str();
  options.plugin_directories = directories;
  options.plugin_directory_count = 1;
  options.position = 1;
  hamelin_controller* const arm = hamelin_controller_create(&options, error, sizeof error);
  CAPTURE(error);
  REQUIRE(arm != nullptr);
  CHECK(hamelin_controller_set_target_twist(arm, 0.0, nullptr, nullptr, error, sizeof error) != 0);
  const double v[3] = {0.0, 0.1, 0.0}, w[3] = {0.0, 0.0, 0.0};
  CHECK(hamelin_controller_set_target_twist(arm, 0.0, v, w, error, sizeof error) != 0);
  CHECK(std::string(error) == "target: no goal follows a streamed target, expected a follow goal");
  hamelin_target_stream stream{};
  stream.struct_size = sizeof stream;
  stream.gap_max_s = 0.05;
  std::uint64_t number = 0;
  REQUIRE(hamelin_controller_follow(arm, &stream, &number, error, sizeof error) == 0);
  double q[7] = {0, -0.785, 0, -2.356, 0, 1.571, 0.785}, rate[7] = {0};
  hamelin_answer answer{};
  answer.struct_size = sizeof answer;
  double from_y = 0.0;
  const double period = hamelin_controller_period_s(arm);
  for (int k = 0; k < 1200; ++k) {
    hamelin_controller_tick(arm, k * period, q, rate, &answer);
    std::copy_n(answer.q_next, 7, q);
    std::copy_n(answer.v_next, 7, rate);
    if (k == 0) {
      CHECK(answer.target == HAMELIN_TARGET_WAITING);
      CHECK(answer.goals == number);
      from_y = answer.target_position_m[1];
    }
    if (k < 1000)
      CHECK(hamelin_controller_set_target_twist(arm, k * period, v, w, error, sizeof error) == 0);
    if (k == 999) CHECK(answer.target == HAMELIN_TARGET_FOLLOWED);
  }
  CHECK(answer.target == HAMELIN_TARGET_LOST);
  CHECK(answer.target_position_m[1] - from_y == Approx(0.105).margin(0.003));
  CHECK(answer.target_error_m < 0.005);

  hamelin_observation pose{};
  pose.struct_size = sizeof pose;
  pose.time_s = 5.0;
  std::copy_n(answer.target_position_m, 3, pose.position_m);
  pose.quaternion_wxyz[1] = 1.0;
  CHECK(hamelin_controller_set_target(arm, &pose, error, sizeof error) == 0);
  pose.time_s = 4.0;
  CHECK(hamelin_controller_set_target(arm, &pose, error, sizeof error) != 0);
  CHECK(std::string(error) == "target: time_s is 4, expected a time after that of the last one, 5");
  hamelin_controller_destroy(arm);
}

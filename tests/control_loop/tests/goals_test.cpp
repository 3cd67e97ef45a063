// Goals and parameters that change while a controller runs.
#include <atomic>
#include <catch2/catch.hpp>
#include <thread>

#include "../loop.hpp"
#include "hamelin/control/hamelin_control.h"
#include "hamelin/test/allocations.hpp"

using namespace hamelin;
using test::Loop;
using test::refusal;
using test::sampled;

namespace {

/// Runs until the controller has reached its goals of this list. @return allocations of all ticks
long run_to_goals(Loop& loop, std::uint64_t goals_number, int steps) {
  long allocations = 0;
  for (int k = 0; k < steps; ++k) {
    const control::Answer* answer = nullptr;
    allocations += test::allocations_in([&] { answer = &loop.tick(); });
    if (answer->goals_number == goals_number && answer->state == control::ControlState::reached)
      return allocations;
    loop.step(answer->torque);
  }
  FAIL("goals not reached");
  return allocations;
}

}  // namespace

TEST_CASE("goals that replace others while the arm moves are reached, without allocating",
          "[control][controller]") {
  const scene::Scene scene = sampled("clutter.json");
  Loop loop(scene);
  for (int k = 0; k < 300; ++k) loop.step(loop.tick().torque);
  CHECK(loop.controller.answer().goals_number == 0);

  // back along a path of many way-points
  scene::Goal back = scene::joint_goal(scene.start_q);
  back.path.resize(loop.arm.dof(), 200);
  for (Eigen::Index i = 0; i < 200; ++i)
    back.path.col(i) =
        loop.state.q + static_cast<double>(i + 1) / 200.0 * (scene.start_q - loop.state.q);
  back.path.rightCols(1) = back.q;
  CHECK(loop.controller.set_goal(back) == 1);
  long allocations = run_to_goals(loop, 1, 10000);
  CHECK((loop.state.q - scene.start_q).lpNorm<Eigen::Infinity>() < 0.05);
  CHECK(loop.controller.answer().goal_index == 1);

  // then a list of two, the first of the tip
  dynamics::Workspace ws(loop.arm);
  dynamics::forward_kinematics(loop.arm, ws, loop.state.q);
  const Eigen::Vector3d tip = dynamics::tip_pose(loop.arm, ws).p() + Eigen::Vector3d(0, 0.1, 0.05);
  CHECK(loop.controller.set_goals({scene::position_goal(tip), scene::joint_goal(scene.start_q)}) ==
        2);
  allocations += run_to_goals(loop, 2, 20000);
  CHECK(loop.controller.answer().goal_index == 2);
  CHECK((loop.state.q - scene.start_q).lpNorm<Eigen::Infinity>() < 0.05);
  if (test::counts_allocations()) CHECK(allocations == 0);
}

TEST_CASE("goals that do not fit the arm are refused and change nothing", "[control][controller]") {
  scene::Scene scene = sampled("clutter.json");
  control::Controller::Options options;
  options.path_points_max = 3;
  Loop loop(scene, options);
  const Eigen::Index dof = loop.arm.dof();
  const auto set = [&](scene::Goal goal) {
    return refusal([&] { loop.controller.set_goal(std::move(goal)); });
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(refusal([&] { loop.controller.set_goals({}); }) ==
        "goals: none are given, expected at least one");
  CHECK(set(scene::joint_goal(Eigen::VectorXd::Zero(3))) ==
        "goal 1: q: 3 values given, expected 7 (one per joint of 'arm7')");
  CHECK(set(scene::joint_goal(Eigen::VectorXd::Constant(dof, nan))) ==
        "goal 1: q: is not finite, expected finite numbers");
  CHECK_THAT(set(scene::joint_goal(Eigen::VectorXd::Constant(dof, 9.0))),
             Catch::StartsWith("goal 1: q: 9 is beyond a limit of joint"));
  CHECK_THAT(set(scene::position_goal({0.0, nan, 0.0})), Catch::Contains("pose: is not finite"));
  scene::Goal loose = scene::joint_goal(scene.start_q);
  loose.tolerance_rad = 0.0;
  CHECK(set(loose) == "goal 1: tolerance_rad: 0 is not allowed, expected more than 0");
  scene::Goal path = scene::joint_goal(scene.start_q);
  path.path = scene.start_q.replicate(1, 4);
  CHECK(set(path) == "goal 1: path: 4 way-points, expected at most 3 (path_points_max)");
  path.path = Eigen::MatrixXd::Zero(dof, 2);
  CHECK_THAT(set(path), Catch::Contains("its end is not q"));
  CHECK_THAT(refusal([&] {
               loop.controller.set_goals(
                   {scene::joint_goal(scene.start_q), scene::joint_goal(Eigen::VectorXd::Zero(2))});
             }),
             Catch::StartsWith("goal 2: q: 2 values"));
  CHECK(loop.tick().goals_number == 0);
  path.path = scene.start_q.replicate(1, 3);
  CHECK(loop.controller.set_goal(path) == 1);
  CHECK(loop.tick().goals_number == 1);
}

TEST_CASE("a controller in C takes goals and parameters while it runs", "[control][controller]") {
  const std::string file = (test::data_folder / "scenes/clutter.json").string(),
                    plugins = HAMELIN_TEST_PLUGIN_DIR;
  const char* directory = plugins.c_str();
  hamelin_controller_options options{};
  options.struct_size = sizeof options;
  options.scene_file = file.c_str();
  options.plugin_directories = &directory;
  options.plugin_directory_count = 1;
  std::array<char, 256> error{};
  hamelin_controller* arm = hamelin_controller_create(&options, error.data(), error.size());
  INFO(error.data());
  REQUIRE(arm != nullptr);
  const std::size_t dof = hamelin_controller_dof(arm);
  const scene::Scene scene = scene::read_scene(file);
  const std::vector<double> v(dof, 0.0);
  hamelin_answer answer{};
  answer.struct_size = sizeof answer;
  hamelin_controller_tick(arm, 0.0, scene.start_q.data(), v.data(), &answer);
  CHECK(answer.goals == 0);
  CHECK(answer.state == HAMELIN_CONTROL_RUNNING);

  std::uint64_t number = 0;
  CHECK(hamelin_controller_set_joint_goal(arm, scene.start_q.data(), 0.0, &number, error.data(),
                                          error.size()) == 0);
  CHECK(number == 1);
  hamelin_controller_tick(arm, 0.004, scene.start_q.data(), v.data(), &answer);
  CHECK(answer.goals == 1);
  CHECK(answer.state == HAMELIN_CONTROL_REACHED);

  const std::array<double, 3> position{0.4, 0.1, 0.5};
  const std::array<double, 4> quaternion{0.0, 1.0, 0.0, 0.0};
  CHECK(hamelin_controller_set_pose_goal(arm, position.data(), quaternion.data(), 0.02, 0.1,
                                         &number, error.data(), error.size()) == 0);
  hamelin_controller_tick(arm, 0.008, scene.start_q.data(), v.data(), &answer);
  CHECK(answer.goals == 2);
  CHECK(answer.state == HAMELIN_CONTROL_RUNNING);

  const std::vector<double> beyond(dof, 100.0);
  CHECK(hamelin_controller_set_joint_goal(arm, beyond.data(), 0.1, &number, error.data(),
                                          error.size()) != 0);
  CHECK_THAT(std::string(error.data()), Catch::Contains("beyond a limit"));
  CHECK(hamelin_controller_set_planner_params(arm, "{\"cruise_speed\": 1}", error.data(),
                                              error.size()) == 0);
  CHECK(hamelin_controller_set_planner_params(arm, "{\"cruise_sped\": 1}", error.data(),
                                              error.size()) != 0);
  CHECK_THAT(std::string(error.data()), Catch::Contains("cruise_sped"));
  hamelin_controller_destroy(arm);
}

TEST_CASE("parameters change at the next tick, from any thread, without allocating in it",
          "[control][controller]") {
  const scene::Scene scene = sampled("clutter.json");
  const auto fastest = [&](double cruise) {
    Loop loop(scene);
    double speed = 0.0;
    long allocations = 0;
    for (int k = 0; k < 600; ++k) {
      if (k == 20 && cruise > 0.0)
        std::thread([&] { loop.controller.set_planner_params({{"cruise_speed", cruise}}); }).join();
      const control::Answer* answer = nullptr;
      allocations += test::allocations_in([&] { answer = &loop.tick(); });
      loop.step(answer->torque);
      if (k > 200) speed = std::max(speed, loop.v.norm());
    }
    if (test::counts_allocations()) CHECK(allocations == 0);
    return speed;
  };
  const double usual = fastest(0.0), slow = fastest(0.2);
  CHECK(slow < 0.3);
  CHECK(usual > 2.0 * slow);
}

TEST_CASE("parameters that cannot be changed are refused with the reason and change nothing",
          "[control][controller]") {
  Loop loop(sampled("clutter.json"));
  const Json before = loop.controller.planner_params();
  const auto set = [&](const Json& changes) {
    return refusal([&] { loop.controller.set_planner_params(changes); });
  };
  CHECK(set(Json::array()) == "parameters of planner 'hybrid': /: expected an object");
  CHECK_THAT(set({{"cruise_speed", -1}}), Catch::Contains("/cruise_speed: -1 is not allowed"));
  CHECK_THAT(set({{"cruise_sped", 1}}), Catch::Contains("unknown key 'cruise_sped'"));
  CHECK(set({{"escape", "none"}}) ==
        "parameters of planner 'hybrid': /escape: cannot be changed while it runs, expected "
        "\"search\"");
  CHECK(loop.controller.planner_params() == before);
  loop.controller.set_planner_params({{"margin_m", 0.05}});
  CHECK(loop.controller.planner_params().at("margin_m") == 0.05);

  scene::Scene other = sampled("clutter.json");
  other.planner->name = "breaking";
  Loop fixed(other, {}, {{"how", "never"}});
  CHECK(refusal([&] {
          fixed.controller.set_planner_params({{"at_tick", 3}});
        }) == "parameters of planner 'breaking': cannot be changed while it runs");
}

TEST_CASE("a new start repeats a run, because the planner forgets the first one",
          "[control][controller]") {
  const scene::Scene scene = sampled("clutter.json");
  Loop loop(scene);
  const auto run = [&] {
    loop.state = loop.integrator->start(scene.start_q, Eigen::VectorXd::Zero(loop.arm.dof()));
    loop.v.setZero();
    std::vector<Eigen::VectorXd> torques;
    for (int k = 0; k < 400; ++k) {
      torques.push_back(loop.tick().torque);
      loop.step(torques.back());
    }
    return torques;
  };
  const auto first = run();
  loop.controller.reset();
  const auto second = run();
  for (std::size_t k = 0; k < first.size(); ++k) {
    INFO("tick " << k);
    REQUIRE(first[k] == second[k]);
  }
}

TEST_CASE("two threads replace goals and parameters while ticks go on", "[control][controller]") {
  const scene::Scene scene = sampled("clutter.json");
  Loop loop(scene);
  std::atomic<bool> stop{false};
  std::thread goals([&] {
    for (int i = 0; !stop; ++i) {
      scene::Goal goal = scene::joint_goal(scene.start_q);
      goal.q[0] += 0.01 * (i % 10);
      if (i % 2 == 0) goal.path = goal.q.replicate(1, 1 + i % 50);
      loop.controller.set_goal(goal);
    }
  });
  std::thread params([&] {
    for (int i = 0; !stop; ++i)
      loop.controller.set_planner_params({{"cruise_speed", 1.0 + 0.01 * (i % 10)}});
  });
  long allocations = 0, changes = 0;
  std::uint64_t last = 0;
  for (int k = 0; changes < 200 && k < 1'000'000; ++k) {
    if (k % 16 == 0) std::this_thread::yield();  // on a busy machine the writers wait for a core
    const control::Answer* answer = nullptr;
    allocations += test::allocations_in([&] { answer = &loop.tick(); });
    if (answer->goals_number != last) ++changes;
    CHECK(answer->goals_number >= last);
    last = answer->goals_number;
    CHECK(answer->torque.allFinite());
  }
  stop = true;
  goals.join();
  params.join();
  CHECK(changes == 200);
  if (test::counts_allocations()) CHECK(allocations == 0);
}

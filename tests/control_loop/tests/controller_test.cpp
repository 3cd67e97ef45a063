#include <atomic>
#include <catch2/catch.hpp>
#include <random>
#include <thread>

#include "../loop.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/test/allocations.hpp"

using namespace hamelin;
using Eigen::Vector3d;
using Eigen::VectorXd;
using test::Loop;
using test::sampled;

TEST_CASE("a controller without a simulation takes an arm to its goals, each step proved clear",
          "[control][controller]") {
  const scene::Scene scene = sampled("clutter.json");
  Loop loop(scene);
  control::ControlState state = control::ControlState::running;
  int uncertified = 0;
  double clearance = 1.0;
  for (int k = 0; k < 20000 && state == control::ControlState::running; ++k) {
    const control::Answer& answer = loop.tick();
    state = answer.state;
    clearance = std::min(clearance, loop.controller.view().clearance_m());
    if (loop.controller.verdict() && !loop.controller.verdict()->certified) ++uncertified;
    loop.step(answer.torque);
  }
  CHECK(state == control::ControlState::reached);
  CHECK(loop.controller.answer().goal_index == scene.goals.size());
  CHECK(clearance > 0.0);
  CHECK(uncertified == 0);
}

TEST_CASE("an obstacle that is added while the arm moves is avoided", "[control][controller]") {
  const scene::Scene scene = sampled("clutter.json");
  const auto clearance_of_crate = [&](bool tell) {
    Loop loop(scene);
    scene::Obstacle crate;
    crate.name = "crate";
    crate.radius_m = 0.08;
    double least = 1.0;
    for (int k = 0; k < 6000; ++k) {
      const control::Answer& answer = loop.tick();
      if (k == 300) {  // in the way of the arm without it
        const geometry::SE3 tip = dynamics::tip_pose(loop.arm, loop.controller.view().poses());
        crate.pose = {Eigen::Matrix3d::Identity(), tip.p() + Vector3d(0.12, 0.12, 0.16)};
        if (tell) loop.controller.world().set_obstacle(crate);
      }
      if (k > 300) {
        scene::PlacedShapes shapes(loop.arm);
        shapes.place(loop.arm, loop.controller.view().poses());
        const scene::Environment alone(std::nullopt, {crate}, scene.base, 2.0, 0.5);
        least = std::min(least, alone.clearance(shapes.view(), 0.0, 1.0));
      }
      loop.step(answer.torque);
    }
    return least;
  };
  CHECK(clearance_of_crate(false) < 0.0);
  CHECK(clearance_of_crate(true) > 0.0);
}

TEST_CASE("a planner that fails is replaced by a brake that brings the arm to rest",
          "[control][controller]") {
  for (const std::string how : {"throw", "nan"}) {
    scene::Scene scene = sampled("clutter.json");
    scene.planner->name = "breaking";
    Loop loop(scene, {}, {{"at_tick", 100}, {"how", how}});
    loop.state = loop.integrator->start(scene.start_q, VectorXd::Constant(loop.arm.dof(), 0.2));
    loop.v.setConstant(0.2);
    for (int k = 0; k < 1000; ++k) {
      const control::Answer& answer = loop.tick();
      CHECK(answer.torque.allFinite());
      CHECK((answer.state == control::ControlState::stopping) == (k >= 100));
      CHECK(answer.cause.empty() == (k < 100));
      loop.step(answer.torque);
    }
    CHECK(loop.v.lpNorm<Eigen::Infinity>() < 1e-3);
  }
}

TEST_CASE("positions for the next period follow with bounded acceleration and jerk",
          "[control][controller]") {
  const scene::Scene scene = sampled("clutter.json");
  control::Controller::Options options;
  options.position = true;
  const bool each = GENERATE(false, true);
  VectorXd acceleration_max = VectorXd::Constant(7, 10.0), jerk_max = VectorXd::Constant(7, 2000.0);
  if (each) {  // as arms with a jerk limit for each joint have them
    acceleration_max << 15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0;
    jerk_max = 500.0 * acceleration_max;
  }
  options.acceleration_max.assign(acceleration_max.begin(),
                                  acceleration_max.begin() + (each ? 7 : 1));
  options.jerk_max.assign(jerk_max.begin(), jerk_max.begin() + (each ? 7 : 1));
  Loop loop(scene, options);
  VectorXd q = scene.start_q, v = VectorXd::Zero(loop.arm.dof()), a = v;
  double acceleration = 0.0, jerk = 0.0;  // as shares of their bounds
  control::ControlState state = control::ControlState::running;
  for (int k = 0; k < 20000 && state == control::ControlState::running; ++k) {
    const control::Answer& answer = loop.controller.tick(0.001 * k, q, v);  // perfect servos
    const VectorXd next = (answer.v_next - v) / 0.001;
    acceleration =
        std::max(acceleration, next.cwiseQuotient(acceleration_max).cwiseAbs().maxCoeff());
    if (k > 0)
      jerk = std::max(jerk, (next - a).cwiseQuotient(0.001 * jerk_max).cwiseAbs().maxCoeff());
    CHECK(answer.q_next.isApprox(q + 0.001 * answer.v_next, 1e-12));
    a = next;
    q = answer.q_next;
    v = answer.v_next;
    state = answer.state;
  }
  CHECK(state == control::ControlState::reached);
  CHECK(acceleration <= 1.0 + 1e-9);
  CHECK(jerk <= 1.0 + 1e-6);
  CHECK(acceleration > 0.3);
  options.jerk_max = {1.0, 2.0};
  CHECK_THROWS_WITH(Loop(scene, options),
                    Catch::Contains("jerk_max: 2 values given, expected 1 or 7"));
  options.jerk_max = {0.0};
  CHECK_THROWS_WITH(Loop(scene, options),
                    Catch::Contains("jerk_max: 0, expected positive numbers"));
}

TEST_CASE("a planner is shown the torque that was sent, its own or that of a stop",
          "[control][controller]") {
  scene::Scene scene = sampled("clutter.json");
  scene.planner->name = "reporting";  // drives through obstacles, as far as the shield lets it
  Loop loop(scene);
  double sent = 0.0;
  int stopping = 0;
  for (int k = 0; k < 3000; ++k) {
    const control::Answer& answer = loop.tick();
    if (k > 0) REQUIRE(answer.series[5] == sent);
    sent = answer.torque[0];
    stopping += answer.stopping ? 1 : 0;
    loop.step(answer.torque);
  }
  CHECK(stopping > 10);
  CHECK(stopping < 2990);

  control::Controller::Options positions;
  positions.position = true;
  Loop servos(scene, positions);  // the torque of its set point
  for (int k = 0; k < 100; ++k) {
    const control::Answer& answer =
        servos.controller.tick(0.001 * k, scene.start_q, VectorXd::Zero(7));
    if (k > 0) REQUIRE(answer.series[5] == sent);
    sent = answer.torque[0];
  }
}

TEST_CASE("ticks neither allocate nor tear while two threads change the world",
          "[control][controller]") {
  scene::Scene scene = sampled("clutter.json");
  control::Controller::Options options;
  options.obstacles_max = 8;
  Loop loop(scene, options);
  std::atomic<bool> stop{false};
  std::thread obstacles([&] {
    std::mt19937 random(1);
    while (!stop) {
      scene::Obstacle ball;
      ball.name = "ball " + std::to_string(random() % 4);
      ball.radius_m = 0.05;
      ball.pose = {Eigen::Matrix3d::Identity(),
                   {2.0 + 0.1 * static_cast<double>(random() % 10), 0.0, 0.5}};
      loop.controller.world().set_obstacle(ball);
    }
  });
  std::thread map([&] {
    for (int i = 0; !stop; ++i) {
      scene::MapChangeSpec change;
      (i % 2 == 0 ? change.occupied_m : change.free_m) = {{{0.7, 0.7, 0.0}, {0.8, 0.8, 0.1}}};
      loop.controller.world().change_map(change);
    }
  });
  long allocations = 0, snapshots = 0;
  std::uint64_t last = 0;
  constexpr long ticks_max = 100'000;
  for (long k = 0; snapshots < 200 && k < ticks_max; ++k) {
    const control::Answer* answer = nullptr;
    const long made = test::allocations_in([&] { answer = &loop.tick(); });
    if (k > 0) allocations += made;  // the first tick of a planner may prepare
    if (answer->snapshot != last) ++snapshots;
    CHECK(answer->snapshot >= last);
    last = answer->snapshot;
    CHECK(loop.controller.view().environment().obstacles().size() <= 8);
    loop.step(answer->torque);
  }
  stop = true;
  obstacles.join();
  map.join();
  CHECK(snapshots == 200);
  if (test::counts_allocations()) CHECK(allocations == 0);
}

// A controller that is reset behaves as one that was just made.
#include <catch2/catch.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "../loop.hpp"

using namespace hamelin;
using Eigen::VectorXd;
using test::sampled;

namespace {

/// All that a tick answers.
struct Outputs {
  std::vector<double> numbers;
  std::vector<int> flags;
  std::string cause;
  bool operator==(const Outputs&) const = default;
};

Outputs outputs_of(control::Controller& controller) {
  const control::Answer& answer = controller.answer();
  Outputs out;
  for (const VectorXd* x : {&answer.torque, &answer.q_next, &answer.v_next})
    out.numbers.insert(out.numbers.end(), x->begin(), x->end());
  for (const double x : answer.series)  // one that is not set is NaN, which equals nothing
    out.numbers.push_back(std::isnan(x) ? -1e300 : x);
  out.numbers.push_back(controller.view().clearance_m());
  if (controller.verdict()) out.numbers.push_back(controller.verdict()->margin_m);
  out.flags = {static_cast<int>(answer.state), static_cast<int>(answer.goal_index),
               answer.stopping ? 1 : 0, answer.saturated ? 1 : 0};
  if (const control::Shield* shield = controller.shield()) {
    out.numbers.push_back(shield->largest_margin_m());
    out.flags.push_back(static_cast<int>(shield->counts().refused));
  }
  out.cause = answer.cause;
  return out;
}

/// Lets an arm follow what the controller says for some ticks, from rest at q.
std::vector<Outputs> run(test::Loop& loop, const VectorXd& q, double from_s, int ticks,
                         bool position) {
  std::vector<Outputs> out;
  loop.state = loop.integrator->start(q, VectorXd::Zero(q.size()));
  loop.v.setZero();
  VectorXd q_now = q, v_now = VectorXd::Zero(q.size());
  for (int k = 0; k < ticks; ++k) {
    const double time_s = from_s + 0.001 * k;
    const control::Answer& answer = loop.controller.tick(time_s, q_now, v_now);
    out.push_back(outputs_of(loop.controller));
    if (position) {
      q_now = answer.q_next;
      v_now = answer.v_next;
    } else {
      loop.step(answer.torque);
      q_now = loop.state.q;
      v_now = loop.v;
    }
  }
  return out;
}

struct Case {
  std::string planner;
  bool position, estimates;
  Json params = Json::object();
};

scene::Scene scene_of(const Case& of) {
  scene::Scene scene = sampled("clutter.json");
  scene.planner->name = of.planner;
  scene.actuation.estimates_velocity = of.estimates;
  scene.actuation.delay_s = of.position ? 0.0 : 0.002;
  scene::Obstacle ball;  // so that what evades moving obstacles has something to forget
  ball.name = "ball";
  ball.radius_m = 0.05;
  ball.pose = {Eigen::Matrix3d::Identity(), {0.5, -0.5, 0.6}};
  scene.obstacles.push_back(ball);
  return scene;
}

}  // namespace

TEST_CASE("a controller that is reset answers as one that was just made, tick by tick",
          "[control][controller][reset]") {
  const Case of = GENERATE(values<Case>({{"template", false, false},
                                         {"apf", false, false},
                                         {"gyro", false, false},
                                         {"hybrid", false, false},
                                         {"hybrid", true, false},
                                         {"hybrid", false, true},
                                         {"mppi", false, false},
                                         {"reporting", true, false},
                                         {"reporting", false, false}}));
  CAPTURE(of.planner, of.position, of.estimates);
  const scene::Scene scene = scene_of(of);
  control::Controller::Options options;
  options.position = of.position;
  constexpr int before = 700, after = 500;
  // the arm was moved by hand meanwhile
  VectorXd elsewhere = scene.start_q;
  elsewhere[0] += 0.5;
  elsewhere[3] += 0.4;

  const auto move_ball = [](test::Loop& loop, double time_s) {
    loop.controller.world().move_obstacle("ball", {Eigen::Matrix3d::Identity(), {0.5, -0.5, 0.6}},
                                          {0.0, 0.4, 0.0}, time_s);
  };
  test::Loop used(scene, options, of.params);
  move_ball(used, 0.0);
  const auto first = run(used, scene.start_q, 0.0, before, of.position);
  used.controller.reset();
  move_ball(used, 5.0);
  const auto again = run(used, elsewhere, 5.0, after, of.position);

  test::Loop fresh(scene, options, of.params);
  move_ball(fresh, 0.0);  // numbers of snapshots go on over a reset
  move_ball(fresh, 5.0);
  const auto expected = run(fresh, elsewhere, 5.0, after, of.position);
  for (std::size_t k = 0; k < expected.size(); ++k) {
    CAPTURE(k);
    REQUIRE(again[k].flags == expected[k].flags);
    REQUIRE(again[k].cause == expected[k].cause);
    REQUIRE(again[k].numbers == expected[k].numbers);
  }
  REQUIRE(first.back().numbers != expected.back().numbers);  // the outputs depend on the past
}

TEST_CASE("after a reset nothing is commanded away from where the arm is",
          "[control][controller][reset]") {
  const bool position = GENERATE(false, true);
  const scene::Scene scene = sampled("clutter.json");
  control::Controller::Options options;
  options.position = position;
  test::Loop loop(scene, options);
  (void)run(loop, scene.start_q, 0.0, 1000, position);
  loop.controller.reset();
  VectorXd other = scene.start_q;
  other[0] += 1.0;
  const control::Answer& answer = loop.controller.tick(2.0, other, VectorXd::Zero(7));
  CHECK(answer.state == control::ControlState::running);
  if (position) {
    CHECK((answer.q_next - other).lpNorm<Eigen::Infinity>() < 1e-4);
    return;
  }
  VectorXd gravity(7);
  dynamics::Workspace ws(loop.arm);
  dynamics::gravity_torque(loop.arm, ws, other, gravity);
  CHECK((answer.torque - gravity).lpNorm<Eigen::Infinity>() < 20.0);
}

TEST_CASE("a reset ends a stop after a failure", "[control][controller][reset]") {
  scene::Scene scene = sampled("clutter.json");
  scene.planner->name = "breaking";
  test::Loop loop(scene, {}, {{"at_tick", 50}, {"how", "nan"}});
  (void)run(loop, scene.start_q, 0.0, 100, false);
  REQUIRE(loop.controller.answer().state == control::ControlState::stopping);
  loop.controller.reset();
  const auto again = run(loop, scene.start_q, 1.0, 100, false);
  CHECK(again[49].flags.front() == static_cast<int>(control::ControlState::running));
  CHECK(again[49].cause.empty());
  CHECK(again[50].flags.front() == static_cast<int>(control::ControlState::stopping));
}

TEST_CASE("goals, parameters and loads that are in force stay so over a reset",
          "[control][controller][reset]") {
  scene::Scene scene = sampled("clutter.json");
  control::Controller::Options options;
  options.payload_reach_m = 0.3;
  options.payload_shapes_max = 2;
  const bool remade = GENERATE(false, true);
  if (remade) scene.planner->name = "reporting";
  test::Loop loop(scene, options);
  loop.controller.set_goal(scene::joint_goal(scene.start_q));
  if (!remade) loop.controller.set_planner_params({{"cruise_speed", 0.3}});
  scene::Payload can;
  can.name = "can";
  can.mass_kg = 0.2;
  can.inertia_kg_m2 = 1e-4 * Eigen::Matrix3d::Identity();
  can.spheres.push_back({{0.0, 0.0, 0.05}, 0.02});
  const std::uint64_t load = loop.controller.attach(can, scene.start_q);
  (void)run(loop, scene.start_q, 0.0, 20, false);
  loop.controller.reset();
  (void)run(loop, scene.start_q, 1.0, 20, false);
  CHECK(loop.controller.answer().load == load);
  CHECK(loop.controller.attached() == std::vector<std::string>{"can"});
  CHECK(loop.controller.answer().goals_number == 1);
  CHECK(loop.controller.answer().state == control::ControlState::reached);
  if (!remade) CHECK(loop.controller.planner_params()["cruise_speed"] == 0.3);
}

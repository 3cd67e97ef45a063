// How an arm is stopped, held, and goes on: by request, after failures, and where servos cannot
// follow.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <thread>

#include "../loop.hpp"
#include "hamelin/test/allocations.hpp"

using namespace hamelin;
using Catch::Contains;
using control::ControlState;
using control::StopReason;
using Eigen::VectorXd;
using test::Loop;
using test::not_finite;
using test::sampled;

namespace {

/// Servos with a gain, a lag, a brake, and a force that pushes the tip.
struct Servos {
  explicit Servos(const scene::Scene& scene, control::Controller::Options options = {},
                  const Json& params = Json::object())
      : loop(scene, by_position(std::move(options)), params),
        ws(loop.arm),
        q_point(scene.start_q),
        v_point(VectorXd::Zero(loop.arm.dof())),
        row(v_point) {}

  static control::Controller::Options by_position(control::Controller::Options options) {
    options.position = true;
    return options;
  }

  const control::Answer& tick() {
    const control::Answer& answer = loop.tick();
    // a lag of the first order
    const double share = lag_s > 0.0 ? 1.0 - std::exp(-0.001 / lag_s) : 1.0;
    q_point += share * (answer.q_next - q_point);
    v_point += share * (answer.v_next - v_point);
    return answer;
  }

  void step() {
    if (braked) {  // where it is
      loop.state = loop.integrator->start(loop.state.q, VectorXd::Zero(7));
      loop.state.k = ++steps;
      loop.state.time_s = 0.001 * static_cast<double>(steps);
      loop.v.setZero();
      return;
    }
    // both gains in proportion to the mass that each joint moves
    VectorXd torque = 900.0 * (q_point - loop.state.q) + 60.0 * (v_point - loop.v), gravity(7);
    dynamics::momentum(loop.arm, ws, loop.state.q, torque, torque);
    dynamics::gravity_torque(loop.arm, ws, loop.state.q, gravity);
    torque += gravity;
    dynamics::forward_kinematics(loop.arm, ws, loop.state.q);
    if (push_N != 0.0) {
      const int tip = loop.arm.robot().tip.link;
      dynamics::point_jacobian_transpose(loop.arm, ws, tip, dynamics::tip_pose(loop.arm, ws).p(),
                                         Eigen::Vector3d::UnitY(), row);
      torque += push_N * row;
    }
    loop.step(torque);
    steps = loop.state.k;
  }

  [[nodiscard]] double tracking_error() const {
    return (loop.controller.answer().q_next - loop.state.q).lpNorm<Eigen::Infinity>();
  }

  Loop loop;
  dynamics::Workspace ws;
  VectorXd q_point, v_point, row;
  double lag_s = 0.0, push_N = 0.0;
  bool braked = false;
  long steps = 0;
};

/// The time at which the arm has reached its goal; infinite if it has not within 20 s.
double arrival(Loop& loop) {
  for (int k = 0; k < 20000; ++k) {
    const control::Answer& answer = loop.tick();
    REQUIRE(answer.torque.allFinite());
    REQUIRE(loop.controller.view().clearance_m() > 0.0);
    if (answer.state == ControlState::reached) return loop.state.time_s;
    loop.step(VectorXd(answer.torque));
  }
  return std::numeric_limits<double>::infinity();
}

void move_on(Loop& loop, int ticks) {
  for (int k = 0; k < ticks; ++k) loop.step(VectorXd(loop.tick().torque));
}

}  // namespace

TEST_CASE("an arm stops on request, and goes on when it is told to", "[control][stop]") {
  scene::Scene scene = sampled("clutter.json");
  if (GENERATE(true, false)) scene.safety.type = scene::SafetyType::none;
  Loop loop(scene);
  move_on(loop, 500);
  REQUIRE(loop.v.norm() > 0.1);
  loop.controller.resume();  // without effect
  std::thread([&] {
    const std::string cause = "a person entered the cell";
    loop.controller.stop(cause);
  }).join();
  move_on(loop, 1);
  const control::Answer& answer = loop.controller.answer();
  CHECK(answer.state == ControlState::stopping);
  CHECK(answer.reason == StopReason::request);
  CHECK(answer.cause == "a person entered the cell");
  loop.controller.stop("another cause");
  move_on(loop, 1500);
  CHECK(answer.state == ControlState::stopping);
  CHECK(answer.cause == "a person entered the cell");
  CHECK(loop.v.lpNorm<Eigen::Infinity>() < 1e-3);
  std::thread([&] { loop.controller.resume(); }).join();
  move_on(loop, 1);
  CHECK(answer.state == ControlState::running);
  CHECK(answer.reason == StopReason::none);
  CHECK(answer.cause.empty());
  CHECK(answer.load == 0);
  CHECK(std::isfinite(arrival(loop)));
}

TEST_CASE("a tick that stops, and one that goes on, do not allocate", "[control][stop]") {
  test::require_allocation_count();
  const scene::Scene scene = sampled("clutter.json");
  Loop loop(scene);
  move_on(loop, 300);
  loop.controller.stop("a cause that is far too long for the memory of a short string");
  const auto allocations = [&] { return test::allocations_in([&] { (void)loop.tick(); }); };
  CHECK(allocations() == 0);
  move_on(loop, 300);
  loop.controller.resume();
  CHECK(allocations() == 0);
  CHECK(loop.controller.answer().state == ControlState::running);
}

TEST_CASE(
    "a request that comes after another holds: a stop ends a resumption that no tick has seen",
    "[control][stop]") {
  Loop loop(sampled("clutter.json"));
  move_on(loop, 200);
  loop.controller.stop("first");
  move_on(loop, 400);
  loop.controller.resume();
  loop.controller.stop("second");
  move_on(loop, 1);
  CHECK(loop.controller.answer().state == ControlState::stopping);
  CHECK(loop.controller.answer().cause == "second");
  // the first resumption was for the first stop
  move_on(loop, 200);
  CHECK(loop.controller.answer().state == ControlState::stopping);
  loop.controller.resume();
  move_on(loop, 1);
  CHECK(loop.controller.answer().state == ControlState::running);
}

TEST_CASE("an arm whose planner failed goes on with another planner", "[control][stop]") {
  scene::Scene scene = sampled("clutter.json");
  scene.planner->name = "breaking";
  Loop loop(scene, {}, {{"at_tick", 50}, {"how", "throw"}});
  move_on(loop, 300);
  CHECK(loop.controller.answer().reason == StopReason::planner);
  loop.controller.resume();
  move_on(loop, 300);
  CHECK(loop.controller.answer().state == ControlState::running);
}

TEST_CASE("an arm whose measurements were lost goes on where it is measured then",
          "[control][stop]") {
  scene::Scene scene = sampled("clutter.json");
  scene.actuation.estimates_velocity = GENERATE(false, true);
  CAPTURE(scene.actuation.estimates_velocity);
  Loop loop(scene);
  move_on(loop, 500);
  const VectorXd nowhere = VectorXd::Constant(7, not_finite);
  control::Controller& controller = loop.controller;
  const auto lose = [&](int ticks) {
    for (int k = 0; k < ticks; ++k)
      loop.step(VectorXd(controller.tick(loop.state.time_s, nowhere, nowhere).torque));
  };
  lose(300);
  CHECK(controller.answer().reason == StopReason::measurement);
  controller.resume();  // too early
  lose(1);
  CHECK(controller.answer().state == ControlState::stopping);
  move_on(loop, 500);  // a resumption that came too early is forgotten
  CHECK(controller.answer().state == ControlState::stopping);
  controller.resume();
  move_on(loop, 1);
  CHECK(controller.answer().state == ControlState::running);
  CHECK(std::isfinite(arrival(loop)));
}

TEST_CASE("a resumption waits for a measurement while few are lost, and a stop ends the wait",
          "[control][stop]") {
  control::Controller::Options options;
  options.lost_measurements_max = 10;
  Loop loop(sampled("clutter.json"), options);
  control::Controller& controller = loop.controller;
  const auto lose = [&] { loop.step(VectorXd(controller.tick_unseen().torque)); };
  move_on(loop, 300);
  controller.stop("a request");
  move_on(loop, 400);
  controller.resume();
  lose();
  CHECK(controller.answer().state == ControlState::stopping);
  const bool stops = GENERATE(false, true);
  if (stops) controller.stop("another request");
  move_on(loop, 1);
  CHECK((controller.answer().state == ControlState::stopping) == stops);
  if (stops) controller.resume();
  move_on(loop, 1);
  CHECK(controller.answer().state == ControlState::running);
}

TEST_CASE("a clock that failed and is right again is no obstacle to going on", "[control][stop]") {
  Loop loop(sampled("clutter.json"));
  move_on(loop, 300);
  for (int k = 0; k < 200; ++k)
    loop.step(VectorXd(loop.controller.tick(not_finite, loop.state.q, loop.v).torque));
  // it is a little behind what the controller took for the time meanwhile
  loop.state.time_s -= 0.0005;
  loop.controller.resume();
  (void)loop.tick();
  CHECK(loop.controller.answer().state == ControlState::running);
}

TEST_CASE("an arm cannot go on from where it could not stop, and says so", "[control][stop]") {
  Loop loop(sampled("clutter.json"));
  move_on(loop, 300);
  loop.controller.stop("a request");
  move_on(loop, 500);
  scene::Obstacle post;
  post.name = "post";
  post.radius_m = 0.03;
  post.pose = {Eigen::Matrix3d::Identity(),
               loop.controller.tip() * Eigen::Vector3d(0.0, 0.0, 0.03)};
  loop.controller.world().set_obstacle(post);
  loop.controller.resume();
  move_on(loop, 1);
  CHECK(loop.controller.answer().state == ControlState::stopping);
  CHECK_THAT(std::string(loop.controller.answer().cause),
             Contains("cannot go on: ") && Contains("would come too near obstacle 'post'"));
  CHECK(loop.controller.answer().refused_load == 0);
  loop.controller.world().remove_obstacle("post");
  loop.controller.resume();
  move_on(loop, 1);
  CHECK(loop.controller.answer().state == ControlState::running);
}

TEST_CASE("a load that is attached while an arm is held stays attached when it goes on",
          "[control][stop]") {
  Loop loop(sampled("clutter.json"), test::with_room());
  move_on(loop, 300);
  loop.controller.stop("a request");
  move_on(loop, 500);
  if (GENERATE(true, false)) {
    loop.controller.attach(test::small_can(), loop.state.q);
    loop.controller.resume();
  } else {
    loop.controller.resume();
    loop.controller.attach(test::small_can(), loop.state.q);
  }
  move_on(loop, 1);
  CHECK(loop.controller.answer().state == ControlState::running);
  CHECK(loop.controller.answer().load == 1);
  CHECK(loop.controller.attached() == std::vector<std::string>{"can"});
}

TEST_CASE("a set point does not run away from an arm that is held, pushed or late",
          "[control][stop]") {
  scene::Scene scene = sampled("clutter.json");
  if (GENERATE(true, false)) scene.safety.type = scene::SafetyType::none;
  Servos servos(scene);
  servos.lag_s = 0.02;
  control::Controller& controller = servos.loop.controller;
  const control::Answer& answer = controller.answer();
  const VectorXd speed_max = control::modelled_limits(scene, servos.loop.arm.robot()).velocity_max;
  REQUIRE(speed_max.size() == 7);
  double farthest = 0.0, fastest = 0.0;
  int braking_ticks = 0;  // of 1 ms
  const auto move = [&](int ticks) {
    for (int k = 0; k < ticks; ++k) {
      const VectorXd before = answer.q_next;
      const bool first = k == 0;
      servos.tick();
      REQUIRE((answer.v_next.cwiseAbs() - speed_max).maxCoeff() <= 1e-9);
      if (!first) REQUIRE((answer.q_next - before).cwiseAbs().maxCoeff() < 0.01);
      farthest = std::max(farthest, servos.tracking_error());
      const double speed = answer.v_next.lpNorm<Eigen::Infinity>();
      fastest = std::max(fastest, speed);
      if (answer.state == ControlState::stopping && speed > 1e-3) ++braking_ticks;
      servos.step();
    }
  };
  move(400);
  REQUIRE(answer.state == ControlState::running);
  REQUIRE(servos.loop.v.norm() > 0.1);
  servos.braked = true;
  move(5000);
  CHECK(answer.state == ControlState::stopping);
  CHECK(answer.reason == StopReason::tracking);
  CHECK_THAT(std::string(answer.cause),
             Contains("from its set point, expected at most 0.1 (tracking_max)"));
  // the bound, and the way on which the fastest joint comes to rest within its torque
  CHECK(braking_ticks < 150);
  CHECK(farthest < 0.1 + 0.5 * 0.15 * fastest);
  CHECK(answer.v_next.lpNorm<Eigen::Infinity>() < 1e-3);
  servos.braked = false;
  move(500);
  CHECK(answer.state == ControlState::stopping);

  controller.resume();
  move(1);
  CHECK(answer.state == ControlState::running);
  servos.push_N = 30.0;  // what the servos withstand
  move(300);
  CHECK(answer.state == ControlState::running);
  servos.push_N = 300.0;
  move(1000);
  CHECK(answer.reason == StopReason::tracking);
  servos.push_N = 0.0;
  move(500);
  controller.resume();
  for (int k = 0; k < 20000 && answer.state != ControlState::reached; ++k) move(1);
  CHECK(answer.state == ControlState::reached);
}

TEST_CASE("bounds of tracking that cannot be are refused", "[control][stop]") {
  const scene::Scene scene = sampled("clutter.json");
  control::Controller::Options options;
  options.position = true;
  options.tracking_max = {0.1, -1.0};
  CHECK_THAT(test::refusal([&] { Loop loop(scene, options); }), Contains("tracking_max"));
}

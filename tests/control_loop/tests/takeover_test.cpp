// An arm that goes on with another load, after a stop, or after measurements were lost, while it
// moves: what it is sent goes on from what it was sent last, and where that acts.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <utility>

#include "../loop.hpp"

using namespace hamelin;
using control::ControlState;
using Eigen::VectorXd;
using test::Loop;
using test::sampled;

namespace {

constexpr double period_s = 0.001;

/// Servos that do what they are sent, also with a lag of the first order, and the largest changes
/// of what they are sent.
struct SetPoints {
  explicit SetPoints(const scene::Scene& scene, double lag_s = 0.0)
      : loop(scene, options()),
        q(scene.start_q),
        v(VectorXd::Zero(7)),
        q_sent(q),
        v_sent(v),
        a(v),
        share(lag_s > 0.0 ? 1.0 - std::exp(-period_s / lag_s) : 1.0) {}

  static control::Controller::Options options() {
    control::Controller::Options options = test::with_room();
    options.position = true;
    return options;
  }

  void move(int ticks) {
    for (int k = 0; k < ticks; ++k) {
      const control::Answer& answer =
          loop.controller.tick(period_s * static_cast<double>(at++), q, v);
      const VectorXd rate = (answer.v_next - v_sent) / period_s;
      acceleration = std::max(acceleration, rate.lpNorm<Eigen::Infinity>());
      jerk = std::max(jerk, (rate - a).lpNorm<Eigen::Infinity>() / period_s);
      jump = std::max(jump, (answer.q_next - q_sent).lpNorm<Eigen::Infinity>());
      q_sent = answer.q_next;
      v_sent = answer.v_next;
      a = rate;
      v = share < 1.0 ? VectorXd(share / period_s * (q_sent - q)) : v_sent;
      q += share * (q_sent - q);
    }
  }

  Loop loop;
  VectorXd q, v, q_sent, v_sent, a;
  double share;
  long at = 0;
  double acceleration = 0.0, jerk = 0.0, jump = 0.0;
};

}  // namespace

TEST_CASE("a stop after a resumption begins where the torques on their way have brought the arm",
          "[control][takeover]") {
  scene::Scene scene = sampled("clutter.json");
  scene.actuation.delay_s = period_s;
  if (GENERATE(false, true)) scene.actuation.torque_rate_max_Nm_s = 2000.0;
  Loop loop(scene);
  VectorXd waiting(7);
  dynamics::Workspace ws(loop.arm);
  dynamics::gravity_torque(loop.arm, ws, scene.start_q, waiting);
  const auto move = [&](int ticks) {
    for (int k = 0; k < ticks; ++k) loop.step(std::exchange(waiting, VectorXd(loop.tick().torque)));
  };
  double slowest = 10.0;
  for (int round = 0; round < 8; ++round) {
    move(150);
    loop.controller.stop("a request");
    move(3);
    loop.controller.resume();
    loop.controller.stop("another request");
    slowest = std::min(slowest, loop.v.lpNorm<Eigen::Infinity>());
    move(1);
    CHECK(loop.controller.answer().state == ControlState::stopping);
    move(60);
    loop.controller.resume();
  }
  CHECK(slowest > 0.05);  // it moved
  CHECK(loop.controller.shield_report()->counts.strayed_share <= 1.0);
}

TEST_CASE("set points go on without a jump of their acceleration after a resumption and a load",
          "[control][takeover]") {
  const double lag_s = GENERATE(0.0, 0.01);
  CAPTURE(lag_s);
  scene::Scene scene = sampled("clutter.json");
  scene.actuation.estimates_velocity = GENERATE(false, true);
  SetPoints points(scene, lag_s);
  control::Controller& controller = points.loop.controller;
  double slowest = 10.0;
  for (int round = 0; round < 8; ++round) {
    points.move(150);
    controller.stop("a request");
    points.move(2);
    slowest = std::min(slowest, points.v.lpNorm<Eigen::Infinity>());
    controller.resume();
    points.move(5);
    CHECK(controller.answer().state == ControlState::running);
    if (round % 2 == 0)
      controller.attach(test::small_can(), points.q);
    else
      controller.detach("can", points.q);
    controller.stop("at the same time");
    points.move(60);
    CHECK(controller.answer().load == static_cast<std::uint64_t>(round + 1));
    controller.resume();
  }
  CHECK(slowest > 0.05);
  CHECK(points.acceleration <= 15.0 * (1.0 + 1e-6));
  CHECK(points.jerk <= 5000.0 * (1.0 + 1e-6));
  CHECK(points.jerk > 1000.0);
  CHECK(points.jump < 2.7 * period_s);
}

TEST_CASE("set points of servos that rest elsewhere go on from there", "[control][takeover]") {
  SetPoints points(sampled("clutter.json"));
  points.move(150);
  points.loop.controller.stop("a request");
  points.move(400);
  REQUIRE(points.v.isZero(0.0));
  points.q[1] += 0.02;  // where brakes hold it
  points.loop.controller.resume();
  const VectorXd held = points.q;
  points.move(1);
  CHECK(points.loop.controller.answer().state == ControlState::running);
  CHECK((points.q_sent - held).lpNorm<Eigen::Infinity>() < 1e-4);
}

TEST_CASE("an estimated velocity goes on over measurements that are lost while it changes",
          "[control][takeover]") {
  scene::Scene scene = sampled("clutter.json");
  scene.actuation.estimates_velocity = true;
  Loop loop(scene);
  const auto move = [&](int ticks) {
    for (int k = 0; k < ticks; ++k) loop.step(VectorXd(loop.tick().torque));
  };
  move(400);
  const double before = loop.v.norm();
  loop.controller.stop("a request");
  move(3);
  const int lost = GENERATE(1, 3);
  const VectorXd nowhere = VectorXd::Constant(7, test::not_finite);
  for (int k = 0; k < lost; ++k)
    loop.step(VectorXd(loop.controller.tick(loop.state.time_s, nowhere, nowhere).torque));
  const VectorXd v = loop.v;
  (void)loop.tick();
  CHECK((loop.controller.v() - v).lpNorm<Eigen::Infinity>() < 3e-3);
  CHECK(before - v.norm() > 0.05);  // it brakes
}

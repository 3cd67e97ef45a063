// An arm that goes on with another load, or after a stop, while it moves: what it is sent goes on
// from what it was sent last, and where that acts.
#include <algorithm>
#include <catch2/catch.hpp>
#include <utility>

#include "../loop.hpp"

using namespace hamelin;
using control::ControlState;
using Eigen::VectorXd;
using test::Loop;
using test::sampled;

namespace {

constexpr double period_s = 0.001;

/// Servos that do exactly what they are sent, and the largest changes of that.
struct SetPoints {
  explicit SetPoints(const scene::Scene& scene)
      : loop(scene, options()), q(scene.start_q), v(VectorXd::Zero(7)), a(v) {}

  static control::Controller::Options options() {
    control::Controller::Options options = test::with_room();
    options.position = true;
    return options;
  }

  void move(int ticks) {
    for (int k = 0; k < ticks; ++k) {
      const control::Answer& answer =
          loop.controller.tick(period_s * static_cast<double>(at++), q, v);
      const VectorXd rate = (answer.v_next - v) / period_s;
      acceleration = std::max(acceleration, rate.lpNorm<Eigen::Infinity>());
      jerk = std::max(jerk, (rate - a).lpNorm<Eigen::Infinity>() / period_s);
      q = answer.q_next;
      v = answer.v_next;
      a = rate;
    }
  }

  Loop loop;
  VectorXd q, v, a;
  long at = 0;
  double acceleration = 0.0, jerk = 0.0;
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
  CHECK(loop.controller.shield()->counts().strayed_share <= 1.0);
}

TEST_CASE("set points go on without a jump of their acceleration after a resumption and a load",
          "[control][takeover]") {
  SetPoints points(sampled("clutter.json"));
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
}

#include <Eigen/LU>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/reactive/torque_ramp.hpp"
#include "hamelin/test/random_mass.hpp"

using Eigen::MatrixXd;
using Eigen::VectorXd;
using namespace hamelin::reactive;

namespace {

struct Approach {
  double nearest = 1.0;  // to the margin
  double last_position = 0.0;
  int reversals = 0;  // of the velocity
};

// A mass that is driven towards a margin at 1 m/s by a force of limited rate, and stays before it.
// `aware`: with the coasting velocity and the loss of the ramp.
Approach approach(double mass, double rate, double start, bool aware) {
  constexpr double period = 0.001, horizon = 0.01, gamma = 16.0, brake = 3.0;
  const MatrixXd W = MatrixXd::Constant(1, 1, 1.0 / mass);
  const VectorXd row = VectorXd::Constant(1, -1.0), zero = VectorXd::Zero(1);
  TorqueRamp ramp(VectorXd::Constant(1, rate), period, 0.0);
  VectorXd force = zero, v = zero;
  double distance = start;
  Approach out;
  for (int k = 0; k < 3000; ++k) {
    ramp.update(force, zero, W, v);
    const double w = aware ? ramp.coasting_velocity()[0] : v[0];
    const double limit = aware ? approach_speed(distance, brake, gamma, ramp.loss(row, W, brake))
                               : approach_speed(distance, brake, gamma);
    const double x = std::min(w + horizon * std::clamp(10.0 * (1.0 - w), -6.0, 6.0), limit);
    VectorXd next = VectorXd::Constant(1, mass * (x - w) / horizon);
    ramp.limit(next, force);
    force = next;
    const double before = v[0];
    v[0] += period * force[0] / mass;
    if (before > 0.01 && v[0] < -0.01) ++out.reversals;
    distance -= period * 0.5 * (before + v[0]);
    out.nearest = std::min(out.nearest, distance);
  }
  out.last_position = distance;
  return out;
}

}  // namespace

TEST_CASE("a mass with a limited rate of force stops before its margin", "[hybrid][ramp]") {
  const double mass = GENERATE(0.5, 2.0, 8.0), rate = GENERATE(100.0, 1000.0),
               start = GENERATE(0.15, 0.5);
  CAPTURE(mass, rate, start);
  const Approach stop = approach(mass, rate, start, true);
  CHECK(stop.nearest > -1e-4);
  CHECK(stop.last_position < 1e-3);  // it arrives
  CHECK(stop.reversals == 0);
}

TEST_CASE("without regard to the ramp it overshoots", "[hybrid][ramp]") {
  CHECK(approach(8.0, 100.0, 0.5, false).nearest < -0.01);
}

TEST_CASE("the coasting velocity is that after every torque has returned at its rate",
          "[hybrid][ramp]") {
  hamelin::Rng rng(3);
  const int n = 4;
  const MatrixXd M = hamelin::test::random_mass(rng, n), W = M.inverse();
  const VectorXd rate = VectorXd::LinSpaced(n, 200.0, 1400.0), v = VectorXd::LinSpaced(n, -1, 1);
  const VectorXd neutral = VectorXd::LinSpaced(n, 3.0, -5.0);
  const VectorXd last = neutral + Eigen::Vector4d(12.0, -7.0, 0.0, 30.0);
  TorqueRamp ramp(rate, 0.001, 0.0);
  ramp.update(last, neutral, W, v);
  VectorXd torque = last, end = v;
  constexpr double dt = 1e-6;
  for (int k = 0; k < 100000; ++k) {
    end += dt * (W * (torque - neutral));
    for (int j = 0; j < n; ++j) {
      const double excess = last[j] - neutral[j];
      const double left = std::max(0.0, std::abs(excess) - rate[j] * dt * (k + 1));
      torque[j] = neutral[j] + std::copysign(left, excess);
    }
  }
  CHECK((ramp.coasting_velocity() - end).norm() < 1e-3 * (end - v).norm());
}

TEST_CASE("an approach speed with a lag covers the lag's way and the way of braking",
          "[hybrid][ramp]") {
  constexpr double gamma = 16.0, brake = 3.0;
  for (const double lag : {0.0, 0.005, 0.05}) {
    for (double x = -0.05; x < 1.0; x += 0.01) {
      const double speed = approach_speed(x, brake, gamma, {lag, 0.0});
      const double way = speed <= brake / gamma
                             ? speed / gamma
                             : speed * speed / (2.0 * brake) + brake / (2.0 * gamma * gamma);
      CAPTURE(lag, x);
      CHECK(way + speed * lag == Approx(x).margin(1e-12));
      if (lag == 0.0) CHECK(speed == Approx(approach_speed(x, brake, gamma)).margin(1e-12));
    }
  }
}

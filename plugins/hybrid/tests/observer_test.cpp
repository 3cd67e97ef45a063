#include "../src/observer.hpp"

#include <Eigen/Dense>
#include <catch2/catch.hpp>

#include "random_mass.hpp"

using namespace hamelin;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using hybrid::Observer;

namespace {

constexpr double period = 0.002;

/// Simulates a plant M v̇ = τ − bias + M d whose torque acts delay_periods ticks late.
/// @return the observer's estimate after each tick
template <class Torque>
std::vector<VectorXd> observe(int ticks, int delay_periods, const VectorXd& disturbance,
                              Torque&& torque, double velocity_noise = 0.0) {
  Rng rng(4);
  const auto n = disturbance.size();
  const MatrixXd M = test::random_mass(rng, static_cast<int>(n)), M_inv = M.inverse();
  const VectorXd bias = test::random_numbers(rng, static_cast<int>(n), 5.0);
  Observer observer(n, period, delay_periods);
  std::vector<VectorXd> issued, estimates;
  VectorXd v = VectorXd::Zero(n);
  for (int k = 0; k < ticks; ++k) {
    VectorXd measured = v;
    for (auto& one : measured) one += rng.uniform(-velocity_noise, velocity_noise);
    observer.update(measured);
    estimates.push_back(observer.disturbance());
    issued.push_back(bias + torque(k));
    observer.issue(issued.back(), measured, M_inv, bias);
    REQUIRE(observer.ready());
    REQUIRE(observer.last() == issued.back());
    const VectorXd acts =
        k < delay_periods ? bias : issued[static_cast<std::size_t>(k - delay_periods)];
    v += period * (M_inv * (acts - bias) + disturbance);
  }
  return estimates;
}

const auto shaking = [](int k) -> VectorXd {
  return Eigen::Vector3d(std::sin(0.3 * k), std::cos(0.2 * k), k % 7 < 3 ? 1.0 : -1.0);
};

}  // namespace

TEST_CASE("with an exact model the observer estimates zero for any delay", "[hybrid][observer]") {
  const int delay_periods = GENERATE(0, 1, 3);
  CAPTURE(delay_periods);
  for (const auto& estimate : observe(200, delay_periods, VectorXd::Zero(3), shaking))
    REQUIRE(estimate.norm() < 1e-9);
}

TEST_CASE("the observer estimates a disturbance with its bandwidth", "[hybrid][observer]") {
  const int delay_periods = GENERATE(0, 1, 3);
  CAPTURE(delay_periods);
  const VectorXd disturbance = Eigen::Vector3d(1.0, -2.0, 0.5);
  const auto estimates = observe(200, delay_periods, disturbance, shaking);
  CHECK(estimates.front().norm() == 0.0);
  CHECK((estimates.back() - disturbance).norm() < 1e-6);
  // A first-order lag of 100/s, docs/theory.md (10.23).
  for (std::size_t k = 0; k < estimates.size(); ++k)
    REQUIRE(
        (estimates[k] - (1.0 - std::exp(-100.0 * period * static_cast<double>(k))) * disturbance)
            .norm() < 1e-9);
}

TEST_CASE("an observer without the delay mistakes it for a disturbance", "[hybrid][observer]") {
  // The same run without the delay shows that the claim above depends on it.
  const MatrixXd one = MatrixXd::Identity(3, 3);
  Observer observer(3, period, 0);
  VectorXd v = VectorXd::Zero(3), acts = v;
  double most = 0.0;
  for (int k = 0; k < 200; ++k) {
    observer.update(v);
    most = std::max(most, observer.disturbance().norm());
    const VectorXd issued = shaking(k);
    observer.issue(issued, v, one, VectorXd::Zero(3));
    v += period * acts;  // one tick late
    acts = issued;
  }
  CHECK(most > 0.1);
}

TEST_CASE("an observer that is told which torque was sent does not take the rest for a disturbance",
          "[hybrid][observer]") {
  // something between planner and arm lets only half of each torque pass
  const int delay_periods = GENERATE(0, 2);
  const MatrixXd one = MatrixXd::Identity(3, 3);
  const VectorXd zero = VectorXd::Zero(3);
  const auto most = [&](bool told) {
    Observer observer(3, period, delay_periods);
    std::vector<VectorXd> sent(static_cast<std::size_t>(delay_periods) + 1, zero);
    VectorXd v = zero;
    double largest = 0.0;
    for (int k = 0; k < 200; ++k) {
      if (told) observer.correct(sent.back());
      observer.update(v);
      largest = std::max(largest, observer.disturbance().norm());
      observer.issue(shaking(k), v, one, zero);
      sent.emplace_back(0.5 * shaking(k));
      v += period * sent[sent.size() - 1 - static_cast<std::size_t>(delay_periods)];
    }
    return largest;
  };
  CHECK(most(true) < 1e-9);
  CHECK(most(false) > 0.1);
}

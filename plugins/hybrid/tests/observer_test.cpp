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

/// A plant M v' = τ − bias + M d, its torque so many ticks late; returns what the observer makes of it after each tick.
template <class Torque>
std::vector<VectorXd> observe(int ticks, int late, const VectorXd& missed, Torque&& torque,
                              double velocity_noise = 0.0) {
  Rng rng(4);
  const auto n = missed.size();
  const MatrixXd M = test::random_mass(rng, static_cast<int>(n)), M_inv = M.inverse();
  const VectorXd bias = test::random_numbers(rng, static_cast<int>(n), 5.0);
  Observer observer(n, period, late);
  std::vector<VectorXd> asked, seen;
  VectorXd v = VectorXd::Zero(n);
  for (int k = 0; k < ticks; ++k) {
    VectorXd measured = v;
    for (auto& one : measured) one += rng.uniform(-velocity_noise, velocity_noise);
    observer.update(measured);
    seen.push_back(observer.disturbance());
    asked.push_back(bias + torque(k));
    observer.issue(asked.back(), measured, M_inv, bias);
    REQUIRE(observer.ready());
    REQUIRE(observer.last() == asked.back());
    const VectorXd acts = k < late ? bias : asked[static_cast<std::size_t>(k - late)];
    v += period * (M_inv * (acts - bias) + missed);
  }
  return seen;
}

const auto shaking = [](int k) -> VectorXd {
  return Eigen::Vector3d(std::sin(0.3 * k), std::cos(0.2 * k), k % 7 < 3 ? 1.0 : -1.0);
};

}  // namespace

TEST_CASE("where the model is right the observer sees nothing, however late torques act", "[hybrid][observer]") {
  const int late = GENERATE(0, 1, 3);
  CAPTURE(late);
  for (const auto& seen : observe(200, late, VectorXd::Zero(3), shaking)) REQUIRE(seen.norm() < 1e-9);
}

TEST_CASE("the observer finds what the model misses, at its bandwidth", "[hybrid][observer]") {
  const int late = GENERATE(0, 1, 3);
  CAPTURE(late);
  const VectorXd missed = Eigen::Vector3d(1.0, -2.0, 0.5);
  const auto seen = observe(200, late, missed, shaking);
  CHECK(seen.front().norm() == 0.0);
  CHECK((seen.back() - missed).norm() < 1e-6);
  // a first-order lag of 100/s
  for (std::size_t k = 0; k < seen.size(); ++k)
    REQUIRE((seen[k] - (1.0 - std::exp(-100.0 * period * static_cast<double>(k))) * missed).norm() < 1e-9);
}

TEST_CASE("an observer that takes torques for prompt mistakes their delay for a disturbance", "[hybrid][observer]") {
  // the same run, told of no delay: shows that the claim above depends on it
  const MatrixXd one = MatrixXd::Identity(3, 3);
  Observer observer(3, period, 0);
  VectorXd v = VectorXd::Zero(3), acts = v;
  double most = 0.0;
  for (int k = 0; k < 200; ++k) {
    observer.update(v);
    most = std::max(most, observer.disturbance().norm());
    const VectorXd asked = shaking(k);
    observer.issue(asked, v, one, VectorXd::Zero(3));
    v += period * acts;  // a tick late
    acts = asked;
  }
  CHECK(most > 0.1);
}

#include "loop/state_estimator.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/core/rng.hpp"

using namespace hamelin;
using control::StateEstimator;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

// One period of the errors of (q, v, d), as a matrix: from the errors of the estimator itself,
// which starts with one of (1, 0, 0) while the arm rests at zero.
Matrix3d error_step(double period_s, double bandwidth) {
  const VectorXd zero = VectorXd::Zero(1);
  StateEstimator estimator(1, period_s, bandwidth);
  estimator.start(VectorXd::Ones(1), VectorXd::Zero(1));
  Matrix3d before, after;
  for (int k = 0; k < 4; ++k) {
    const Vector3d error(estimator.q()[0], estimator.v()[0], estimator.disturbance()[0]);
    if (k < 3) before.col(k) = error;
    if (k > 0) after.col(k - 1) = error;
    estimator.update(zero, zero, zero);
  }
  return after * before.inverse();
}

}  // namespace

TEST_CASE("all errors of the estimate decay with one rate", "[control][estimator][unit]") {
  const double period_s = 0.01, bandwidth = GENERATE(5.0, 45.0, 100.0);
  const double theta = std::exp(-bandwidth * period_s);
  // The characteristic polynomial (z - theta)^3, by its coefficients.
  const Matrix3d A = error_step(period_s, bandwidth);
  const double minors = 0.5 * (A.trace() * A.trace() - (A * A).trace());
  CHECK(A.trace() == Approx(3.0 * theta).epsilon(1e-9));
  CHECK(minors == Approx(3.0 * theta * theta).epsilon(1e-9));
  CHECK(A.determinant() == Approx(theta * theta * theta).epsilon(1e-9));
}

TEST_CASE("an unknown constant acceleration leaves no error", "[control][estimator][unit]") {
  const double period_s = 0.001;
  StateEstimator estimator(2, period_s, 45.0);
  const VectorXd known = Eigen::Vector2d(0.3, -1.0), unknown = Eigen::Vector2d(-2.0, 0.5);
  const VectorXd acceleration = known + unknown, q0 = Eigen::Vector2d(0.4, -0.2);
  estimator.start(q0, VectorXd::Zero(2));
  double time_s = 0.0;
  VectorXd q(2), v(2);
  for (int k = 1; k <= 1000; ++k) {
    time_s = period_s * k;
    q = q0 + 0.5 * time_s * time_s * acceleration;
    v = time_s * acceleration;
    estimator.update(q, q, known);  // velocities are not read
  }
  CHECK((estimator.q() - q).norm() < 1e-10);
  CHECK((estimator.v() - v).norm() < 1e-9);
  CHECK((estimator.disturbance() - unknown).norm() < 1e-6);
}

TEST_CASE("noise of positions reaches the velocity as theory says", "[control][estimator][unit]") {
  const double period_s = 0.001, sigma = 1e-4;
  // A stated noise changes nothing as long as there is nothing else.
  const auto [bandwidth, stated] =
      GENERATE(table<double, double>({{30.0, 0.0}, {200.0, 0.0}, {30.0, 1e-4}}));
  const double theta = std::exp(-bandwidth * period_s), rest = 1.0 - theta;
  const double expected =
      sigma * std::sqrt(rest * rest * rest * (13.0 + 50.0 * theta + 49.0 * theta * theta) /
                        (2.0 * period_s * period_s * std::pow(1.0 + theta, 5)));
  StateEstimator estimator(1, period_s, bandwidth, stated);
  const VectorXd zero = VectorXd::Zero(1);
  estimator.start(zero, zero);
  Rng random(7);
  constexpr int settle = 2000, samples = 400'000;
  double sum = 0.0;
  for (int k = 0; k < settle + samples; ++k) {
    estimator.update(VectorXd::Constant(1, sigma * random.normal()), zero, zero);
    if (k >= settle) sum += estimator.v()[0] * estimator.v()[0];
  }
  // About samples * rest / 4 of the values are independent, so the deviation is below 2 %.
  CHECK(std::sqrt(sum / samples) == Approx(expected).epsilon(0.05));
}

TEST_CASE("a bandwidth that rises follows a growing disturbance", "[control][estimator][unit]") {
  const double period_s = 1e-4, bandwidth = 30.0, growth = 100.0, sigma = 1e-4;
  // Where the bandwidth settles: (8.19).
  const double raised = std::pow(growth * bandwidth / sigma, 0.25);
  StateEstimator fixed(1, period_s, bandwidth), adapting(1, period_s, bandwidth, sigma);
  const VectorXd zero = VectorXd::Zero(1);
  for (auto* estimator : {&fixed, &adapting}) estimator->start(zero, zero);
  double v = 0.0;
  for (int k = 1; k <= 10'000; ++k) {
    const double t = period_s * k;
    const VectorXd q = VectorXd::Constant(1, growth * t * t * t / 6.0);
    v = growth * t * t / 2.0;
    for (auto* estimator : {&fixed, &adapting}) estimator->update(q, zero, zero);
  }
  // The theory is that of short periods.
  CHECK(v - fixed.v()[0] == Approx(3.0 * growth / (bandwidth * bandwidth)).epsilon(0.02));
  CHECK(v - adapting.v()[0] == Approx(3.0 * growth / (raised * raised)).epsilon(0.02));
}

TEST_CASE("measured velocities tell of a disturbance with a lag of 100/s",
          "[control][estimator][unit]") {
  const double period_s = GENERATE(0.0005, 0.002);
  const VectorXd disturbance = Vector3d(1.0, -2.0, 0.5), zero = VectorXd::Zero(3);
  StateEstimator estimator(3, period_s);
  estimator.start(zero, zero);
  VectorXd q = zero, v = zero, known = zero;
  for (int k = 1; k <= 200; ++k) {
    known = Vector3d(std::sin(0.3 * k), std::cos(0.2 * k), k % 7 < 3 ? 1.0 : -1.0);
    v += period_s * (known + disturbance);
    estimator.update(q, v, known);
    REQUIRE(estimator.v() == v);
    REQUIRE(
        (estimator.disturbance() - (1.0 - std::exp(-100.0 * period_s * k)) * disturbance).norm() <
        1e-9);
  }
}

TEST_CASE("an estimate goes on without measurements as the model and the disturbance do",
          "[control][estimator][unit]") {
  const double period_s = 0.001;
  const VectorXd known = VectorXd::Constant(1, 0.7), unknown = VectorXd::Constant(1, -0.2);
  const bool measures_velocity = GENERATE(true, false);
  StateEstimator estimator =
      measures_velocity ? StateEstimator(1, period_s) : StateEstimator(1, period_s, 45.0);
  const auto v_at = [&](int k) -> VectorXd { return period_s * k * (known + unknown); };
  const auto q_at = [&](int k) -> VectorXd { return 0.5 * period_s * k * v_at(k); };
  estimator.start(q_at(0), v_at(0));
  for (int k = 1; k <= 1000; ++k) estimator.update(q_at(k), v_at(k), known);
  for (int k = 1001; k <= 1010; ++k) estimator.predict(known);
  CHECK((estimator.q() - q_at(1010)).norm() < 1e-9);
  CHECK((estimator.v() - v_at(1010)).norm() < 1e-8);
  const VectorXd before = estimator.disturbance();
  estimator.move_to(VectorXd::Constant(1, 5.0), VectorXd::Constant(1, -3.0));
  CHECK(estimator.q()[0] == 5.0);
  CHECK(estimator.v()[0] == -3.0);
  CHECK(estimator.disturbance() == before);
}

#include "hamelin/control/motion_estimator.hpp"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/geometry/so3.hpp"
#include "sine_stream.hpp"

using namespace hamelin;
using control::MotionEstimator;
using control::ObservationOptions;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

geometry::SE3 at(const Vector3d& p) {
  return {Matrix3d::Identity(), p};
}

// Covariance of the i-th derivative at s with the position at t, for a position at whose start, at
// time 0, velocity and acceleration have a normal distribution, and whose jerk is white noise.
double covariance(int derivative, double s, double t, double speed, double acceleration,
                  double density) {
  const double low = std::min(s, t);
  const auto integral = [&](auto&& f) {  // Simpson's rule, nearly exact for a quartic
    double sum = 0.0;
    constexpr int pieces = 200;
    const double h = low / pieces;
    for (int i = 0; i < pieces; ++i)
      sum += h / 6.0 * (f(i * h) + 4.0 * f((i + 0.5) * h) + f((i + 1.0) * h));
    return sum;
  };
  const double of_speed[] = {s, 1.0, 0.0}, of_acceleration[] = {0.5 * s * s, s, 1.0};
  return of_speed[derivative] * t * speed * speed +
         of_acceleration[derivative] * 0.5 * t * t * acceleration * acceleration +
         density * integral([&](double u) {
           const double ahead = s - u, to = 0.5 * (t - u) * (t - u);
           return to * (derivative == 0 ? 0.5 * ahead * ahead : derivative == 1 ? ahead : 1.0);
         });
}

}  // namespace

TEST_CASE("the estimate is the mean of the motion given all measured positions",
          "[control][tracking][unit]") {
  // Gaussian process regression, with all measurements at once.
  const ObservationOptions options{.noise_m = 0.003, .jerk_m_s3 = 1.5};
  const double density = 0.5 * 1.5 * 1.5, variance = 0.003 * 0.003;
  const std::vector<double> times{0.0, 0.02, 0.05, 0.051, 0.2, 0.3, 0.62, 0.65};
  const auto count = static_cast<Eigen::Index>(times.size());
  Rng rng(3);
  VectorXd measured(count);
  for (Eigen::Index i = 0; i < count; ++i) measured[i] = 0.4 + 0.05 * rng.normal();

  MotionEstimator estimator(options, 5.0, at({0.0, measured[0], 0.0}));
  for (Eigen::Index i = 1; i < count; ++i)
    estimator.update(5.0 + times[static_cast<std::size_t>(i)], at({0.0, measured[i], 0.0}));

  // The first position is known as well as its measurement: a normal distribution around it.
  MatrixXd among(count, count), with(3, count);
  for (Eigen::Index k = 0; k < count; ++k) {
    const double t = times[static_cast<std::size_t>(k)];
    for (Eigen::Index i = 0; i < count; ++i)
      among(i, k) = variance +
                    covariance(0, times[static_cast<std::size_t>(i)], t, 0.75, 1.5, density) +
                    (i == k && i > 0 ? variance : 0.0);
    for (int d = 0; d < 3; ++d)
      with(d, k) = (d == 0 ? variance : 0.0) + covariance(d, times.back(), t, 0.75, 1.5, density);
  }
  // Without the first one, which is the mean.
  const Eigen::Index rest = count - 1;
  const VectorXd error = measured.tail(rest).array() - measured[0];
  const Vector3d expected =
      with.rightCols(rest) * among.bottomRightCorner(rest, rest).ldlt().solve(error);
  CHECK(estimator.position().y() == Approx(measured[0] + expected[0]).epsilon(1e-8));
  CHECK(estimator.velocity().y() == Approx(expected[1]).epsilon(1e-6));
  CHECK(estimator.acceleration().y() == Approx(expected[2]).epsilon(1e-6));
  CHECK(estimator.velocity().x() == 0.0);
  CHECK(estimator.time_s() == 5.65);
}

TEST_CASE("estimates of a swinging body are better than differences of its poses",
          "[control][tracking][unit]") {
  for (const auto& stream : test::sine_streams()) {
    CAPTURE(stream.period_s, stream.rate_hz, stream.noise_m);
    const auto [estimated, differences, exact] = test::sine_errors(stream, {}, 1);
    CHECK(estimated.velocity_m_s < 0.02 + 8.0 * stream.noise_m);
    CHECK(estimated.acceleration_m_s2 < 0.25 + 70.0 * stream.noise_m);
    CHECK(estimated.prediction_m[0] < 0.004 + 2.0 * stream.noise_m);
    CHECK(estimated.prediction_m[1] < 0.025 + 5.0 * stream.noise_m);
    // The error a second ahead is that of the prediction itself, not of the estimate.
    CHECK(estimated.prediction_m[2] < 1.5 * exact.prediction_m[2] + 60.0 * stream.noise_m);
    if (stream.noise_m == 0.0) continue;
    CHECK(estimated.velocity_m_s < 0.5 * differences.velocity_m_s);
    CHECK(estimated.acceleration_m_s2 < 0.2 * differences.acceleration_m_s2);
    for (std::size_t i = 0; i < 3; ++i)
      CHECK(estimated.prediction_m[i] < 0.4 * differences.prediction_m[i]);
  }
}

TEST_CASE("angular velocities follow a constant turn at irregular times, despite noise",
          "[control][tracking][unit]") {
  const Vector3d rate(0.4, -1.1, 2.0);
  const double noise_rad = GENERATE(0.0, 0.01);
  Rng rng(5);
  double time_s = 2.0, sum = 0.0;
  const auto rotation = [&] {
    const Vector3d noise(rng.normal(), rng.normal(), rng.normal());
    return Matrix3d(geometry::SO3::exp(noise_rad * noise).R() *
                    geometry::SO3::exp(time_s * rate).R());
  };
  MotionEstimator estimator({}, time_s, {rotation(), Vector3d::Zero()});
  int count = 0;
  for (int k = 0; k < 2000; ++k) {
    time_s += rng.uniform(0.01, 0.03);
    estimator.update(time_s, {rotation(), Vector3d::Zero()});
    if (time_s < 4.0) continue;
    sum += (estimator.angular_velocity() - rate).squaredNorm();
    ++count;
  }
  // Differences of rotations have an error of about 0.01 sqrt(6) / 0.02 s = 1.2 rad/s.
  const double error = std::sqrt(sum / count);
  CAPTURE(error);
  CHECK(error < (noise_rad == 0.0 ? 1e-3 : 0.2));
  if (noise_rad == 0.0)
    CHECK((estimator.rotation() - rotation()).norm() < 1e-3);
  else
    CHECK(error > 0.01);  // the noise is there
}

TEST_CASE("streams of thousands of poses leave the gains as they settle",
          "[control][tracking][unit]") {
  control::JerkFilter filter(0.002, 2.0);
  Vector3d settled, last;
  for (int k = 0; k < 200'000; ++k) {
    last = filter.advance(0.01);
    if (k == 1000) settled = last;
  }
  CHECK((last - settled).norm() < 1e-9 * settled.norm());
  CHECK(settled[0] > 0.0);
  CHECK(settled[0] < 1.0);
}

TEST_CASE("options of observations must be above zero", "[control][tracking][unit]") {
  control::check(ObservationOptions{});
  CHECK_THROWS_WITH(control::check({.noise_m = 0.0}),
                    "observations: noise_m is 0, expected a finite number above 0");
  CHECK_THROWS_WITH(control::check({.timeout_s = std::nan("")}),
                    "observations: timeout_s is nan, expected a finite number above 0");
}

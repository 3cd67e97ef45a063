#pragma once
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "hamelin/control/motion_estimator.hpp"
#include "hamelin/core/rng.hpp"

namespace hamelin::test {

/// A body that swings by ±0.25 m on a line, measured with noise.
struct SineStream {
  double period_s, rate_hz, noise_m;
};

/// Root mean square errors of a velocity, an acceleration and the positions that follow from them
/// by constant acceleration a time ahead.
struct MotionErrors {
  static constexpr std::array<double, 3> ahead_s{0.1, 0.3, 1.0};
  double velocity_m_s = 0.0, acceleration_m_s2 = 0.0;
  std::array<double, 3> prediction_m{};
};

struct SineErrors {
  MotionErrors estimated, differences, exact;
};

/// Position, velocity and acceleration.
using Derivatives = std::array<double, 3>;

inline Derivatives sine_at(const SineStream& stream, double time_s) {
  const double omega = 2.0 * std::numbers::pi / stream.period_s, amplitude = 0.25;
  const double s = std::sin(omega * time_s), c = std::cos(omega * time_s);
  return {amplitude * s, amplitude * omega * c, -amplitude * omega * omega * s};
}

inline void add_errors(MotionErrors& sums, const Derivatives& given, const SineStream& stream,
                       double time_s) {
  const Derivatives truth = sine_at(stream, time_s);
  sums.velocity_m_s += std::pow(given[1] - truth[1], 2);
  sums.acceleration_m_s2 += std::pow(given[2] - truth[2], 2);
  for (std::size_t i = 0; i < 3; ++i) {
    const double ahead = MotionErrors::ahead_s[i];
    const double predicted = given[0] + ahead * given[1] + 0.5 * ahead * ahead * given[2];
    sums.prediction_m[i] += std::pow(predicted - sine_at(stream, time_s + ahead)[0], 2);
  }
}

inline void finish_errors(MotionErrors& sums, double count) {
  const auto root = [&](double& sum) { sum = std::sqrt(sum / count); };
  root(sums.velocity_m_s);
  root(sums.acceleration_m_s2);
  for (double& sum : sums.prediction_m) root(sum);
}

/// Errors over 57 s after the first three. Positions are the measured ones, and the true ones for
/// `exact`; `differences` are those of the last two and three positions.
inline SineErrors sine_errors(const SineStream& stream, const control::ObservationOptions& options,
                              std::uint64_t seed) {
  Rng rng(seed);
  SineErrors errors;
  control::MotionEstimator estimator(options, 0.0, {});
  std::array<double, 3> last{};  // the newest first
  double count = 0.0;
  for (long k = 1; static_cast<double>(k) < 60.0 * stream.rate_hz; ++k) {
    const double time_s = static_cast<double>(k) / stream.rate_hz;
    const Derivatives truth = sine_at(stream, time_s);
    last = {truth[0] + stream.noise_m * rng.normal(), last[0], last[1]};
    estimator.update(time_s, {Eigen::Matrix3d::Identity(), {last[0], 0.0, 0.0}});
    if (time_s < 3.0) continue;
    ++count;
    add_errors(errors.exact, truth, stream, time_s);
    add_errors(errors.estimated, {last[0], estimator.velocity().x(), estimator.acceleration().x()},
               stream, time_s);
    add_errors(errors.differences,
               {last[0], stream.rate_hz * (last[0] - last[1]),
                stream.rate_hz * stream.rate_hz * (last[0] - 2.0 * last[1] + last[2])},
               stream, time_s);
  }
  for (MotionErrors* sums : {&errors.estimated, &errors.differences, &errors.exact})
    finish_errors(*sums, count);
  return errors;
}

inline std::vector<SineStream> sine_streams() {
  std::vector<SineStream> streams;
  for (const double period_s : {3.0, 6.0})
    for (const double rate_hz : {30.0, 60.0, 100.0})
      for (const double noise_m : {0.0, 0.001, 0.002})
        streams.push_back({period_s, rate_hz, noise_m});
  return streams;
}

}  // namespace hamelin::test

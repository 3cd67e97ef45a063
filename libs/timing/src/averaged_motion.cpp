#include "averaged_motion.hpp"

#include <algorithm>
#include <cmath>

namespace hamelin::timing {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// Speeds at equal times, in between as if they were linear, and scaled so that these lead to the
// same end.
VectorXd speeds_at(const TimedPath& motion, double step_s) {
  const auto n = static_cast<Index>(std::ceil(motion.duration_s() / step_s));
  VectorXd out = VectorXd::Zero(n + 1);
  Index k = 0;
  for (Index i = 0; i < n; ++i) {
    const double t = step_s * static_cast<double>(i);
    while (k + 2 < motion.nodes() && motion.time_s[k + 1] <= t) ++k;
    out[i] = motion.speed[k] + motion.rate[k] * (t - motion.time_s[k]);
  }
  const double length = motion.place[motion.nodes() - 1] - motion.place[0],
               covered = step_s * (out.sum() - 0.5 * out[0]);
  out *= length / covered;
  return out;
}

}  // namespace

void average(const TimedPath& motion, double window_s, int intervals, TimedPath& out) {
  const double step_s = window_s / intervals;
  const VectorXd speed = speeds_at(motion, step_s);
  const Index n = speed.size() + intervals;
  const auto speed_at = [&](Index i) { return speed[std::clamp<Index>(i, 0, speed.size() - 1)]; };
  // before its beginning the motion rests, or goes on as it begins
  out.place.resize(n);
  out.time_s.resize(n);
  out.speed.resize(n);
  out.rate.resize(n - 1);
  out.ramp.resize(n - 1);
  double sum = intervals * speed[0];  // of speeds in the window, by the trapezoidal rule
  for (Index i = 0; i < n; ++i) {
    out.time_s[i] = step_s * static_cast<double>(i);
    out.speed[i] = std::max(0.0, sum / intervals);
    sum += 0.5 *
           (speed_at(i) + speed_at(i + 1) - speed_at(i - intervals) - speed_at(i + 1 - intervals));
  }
  out.place[0] = motion.place[0];
  for (Index i = 0; i + 1 < n; ++i) {
    const auto change = [&](Index k) { return (speed_at(k) - speed_at(k - intervals)) / window_s; };
    out.rate[i] = change(i);
    out.ramp[i] = (change(i + 1) - change(i)) / step_s;
    out.place[i + 1] =
        out.place[i] +
        step_s * (out.speed[i] + step_s * (0.5 * out.rate[i] + step_s * out.ramp[i] / 6.0));
  }
  out.place[n - 1] = motion.place[motion.nodes() - 1];
  out.speed[n - 1] = 0.0;
}

}  // namespace hamelin::timing

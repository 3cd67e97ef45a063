#include "hamelin/timing/timed_path.hpp"

#include <algorithm>
#include <cmath>

namespace hamelin::timing {

using Eigen::Index;
using Eigen::VectorXd;

void TimedPath::at(double t, VectorXd& q, VectorXd& v, VectorXd& a, Cursor& cursor) const {
  t = std::clamp(t, 0.0, duration_s());
  Index& i = cursor.node;
  if (time_s[i] > t) i = cursor.piece = 0;
  const double *const times = time_s.data(), *const last = times + nodes() - 1;
  i = std::min(std::upper_bound(times + i + 1, last, t) - times, nodes() - 1) - 1;
  const double dt = t - time_s[i], r = ramp[i], u = rate[i] + r * dt,
               w = speed[i] + dt * (rate[i] + 0.5 * r * dt),
               s = place[i] + dt * (speed[i] + dt * (0.5 * rate[i] + dt * r / 6.0));
  cursor.piece = curve.at(s, q, v, a, cursor.piece);
  a = w * w * a + u * v;
  v *= w;
}

double TimedPath::time_at(double place) const {
  double before = 0.0, behind = duration_s();
  constexpr int halvings = 50;
  for (int i = 0; i < halvings; ++i) {
    const double middle = 0.5 * (before + behind);
    (along(middle).place < place ? before : behind) = middle;
  }
  return behind;
}

TimedPath::Along TimedPath::along(double t) const {
  t = std::clamp(t, 0.0, duration_s());
  Index i = 0;
  while (i + 2 < nodes() && time_s[i + 1] <= t) ++i;
  const double dt = t - time_s[i];
  return {place[i] + dt * (speed[i] + dt * (0.5 * rate[i] + dt * ramp[i] / 6.0)),
          speed[i] + dt * (rate[i] + 0.5 * dt * ramp[i])};
}

void TimedPath::chord(Index interval, VectorXd& from, VectorXd& to, VectorXd& stray) const {
  const double a = place[interval], b = place[interval + 1];
  curve.at(a, from, stray, to);
  curve.at(b, to, stray, stray);
  curve.bound_bend(a, b, stray);
  stray *= 0.125 * (b - a) * (b - a);
}

TimedPath::Place TimedPath::project(const VectorXd& q_arm, const VectorXd& v_arm, const Place& near,
                                    Cursor& cursor, VectorXd& q, VectorXd& v, VectorXd& a) const {
  constexpr double least_speed = 0.2, largest_step_s = 0.02, least_slope = 0.3;
  Place out{std::clamp(near.time_s, 0.0, duration_s()), near.rate};
  at(out.time_s, q, v, a, cursor);
  const double square = v.squaredNorm(), along = v.dot(q_arm) - v.dot(q),
               slope = square - a.dot(q_arm) + a.dot(q);
  if (square > least_speed * least_speed && slope > least_slope * square) {
    const double before_s = out.time_s;
    out.time_s = std::clamp(before_s + std::clamp(along / slope, -largest_step_s, largest_step_s),
                            0.0, duration_s());
    at(out.time_s, q, v, a, cursor);
    // near the ends of a path its direction is all that is known, and at them not even that
    if (v.squaredNorm() > least_speed * least_speed)
      out.rate = v_arm.dot(v) / v.squaredNorm();
    else
      at(out.time_s = before_s, q, v, a, cursor);
  }
  out.rate = std::clamp(out.rate, 0.0, 1.0);
  return out;
}

std::vector<double> TimedPath::sample_breaks(double beside_s) const {
  constexpr double jump_share = 0.03;  // of the largest acceleration
  double most = 0.0;
  for (Index k = 0; k + 1 < nodes(); ++k) {
    const double x = speed[k] * speed[k];
    most = std::max(most, (rate[k] * tangent.col(k) + x * curvature.col(k)).cwiseAbs().maxCoeff());
  }
  std::vector<double> out{0.0};
  for (Index k = 1; k + 1 < nodes(); ++k) {
    const double jump =
        std::abs(rate[k] - rate_at_end(k - 1)) * tangent.col(k).cwiseAbs().maxCoeff();
    const double before = time_s[k] - beside_s, behind = time_s[k] + beside_s;
    if (jump < jump_share * most || before <= out.back() || behind >= duration_s()) continue;
    out.push_back(before);
    out.push_back(behind);
  }
  out.push_back(duration_s());
  return out;
}

scene::JointTrajectory TimedPath::sampled(double spacing_s) const {
  constexpr double beside_s = 2.5e-4;
  const std::vector<double> breaks = sample_breaks(std::min(beside_s, 0.25 * spacing_s));
  std::vector<double> times{0.0};
  for (std::size_t i = 1; i < breaks.size(); ++i) {
    const double from = breaks[i - 1], length = breaks[i] - from,
                 count = std::max(1.0, std::ceil(length / spacing_s));
    for (double k = 1.0; k < count; ++k) times.push_back(from + length * k / count);
    times.push_back(breaks[i]);
  }
  const auto n = static_cast<Index>(times.size());
  scene::JointTrajectory out;
  out.time_s = VectorXd::Map(times.data(), n);
  out.q.resize(curve.dof(), n);
  out.v = out.a = out.q;
  VectorXd q(curve.dof()), v(curve.dof()), a(curve.dof());
  Cursor cursor;
  for (Index k = 0; k < n; ++k) {
    at(out.time_s[k], q, v, a, cursor);
    out.q.col(k) = q;
    out.v.col(k) = v;
    out.a.col(k) = a;
  }
  out.v.col(n - 1).setZero();
  return out;
}

}  // namespace hamelin::timing

#include "shield/braking_rate.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "hamelin/core/numbers.hpp"

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// A rate that is tried is below the largest one that the last line allowed by this factor.
constexpr double below_largest = 0.97;
constexpr int tries_max = 8;
// By how much a torque may rise between two points, as a share of its largest second difference: an
// eighth for a parabola, docs/theory.md (14.12).
constexpr double between_points = 0.15;
// Slower motion is at rest for the torques [rad/s or m/s].
constexpr double resting_speed = 1e-9;

}  // namespace

BrakingRate::BrakingRate(const model::Model& model, VectorXd effort_max, VectorXd acceleration_max,
                         double rate_max)
    : model_(model),
      effort_max_(std::move(effort_max)),
      acceleration_max_(std::move(acceleration_max)),
      rate_max_(rate_max),
      last_(rate_max),
      ws_(model) {
  for (auto* x : {&q_, &v_, &a_, &with_rate_, &without_}) x->setZero(model.dof(), points);
  rise_ = VectorXd::Zero(model.dof());
}

double BrakingRate::upper_rate(const VectorXd& w) const {
  double rate = rate_max_;
  for (Index j = 0; j < acceleration_max_.size(); ++j)
    if (w[j] != 0.0) rate = std::min(rate, acceleration_max_[j] / std::abs(w[j]));
  return rate;
}

void BrakingRate::set_line(const VectorXd& q, const VectorXd& w, double rate) {
  const double sigma = 0.5 / rate;
  for (Index k = 0; k < points; ++k) {
    // the last point is that of rest, without deceleration
    const double x = std::min(1.0, static_cast<double>(k) / static_cast<double>(points - 2));
    q_.col(k) = q + sigma * x * w;
    v_.col(k) = std::sqrt(1.0 - x) * w;
  }
}

double BrakingRate::evaluate(const VectorXd& q, const VectorXd& w, double rate) {
  set_line(q, w, rate);
  for (Index k = 0; k < points - 1; ++k) a_.col(k) = -rate * w;
  a_.col(points - 1).setZero();
  dynamics::inverse_dynamics(model_, ws_, q_, v_, a_, with_rate_);
  utilisation_ = 0.0;
  for (Index j = 0; j < effort_max_.size(); ++j) {
    const auto torque = with_rate_.row(j);
    double bend = 0.0;
    for (Index k = 1; k + 2 < points; ++k)
      bend = std::max(bend, std::abs(torque[k - 1] - 2.0 * torque[k] + torque[k + 1]));
    rise_[j] = between_points * bend;
    utilisation_ =
        std::max(utilisation_, (torque.cwiseAbs().maxCoeff() + rise_[j]) / effort_max_[j]);
  }
  return utilisation_;
}

// docs/theory.md (14.12)
std::pair<double, double> BrakingRate::allowed_rates(double rate) {
  a_.setZero();
  dynamics::inverse_dynamics(model_, ws_, q_, v_, a_, without_);
  double low = 0.0, high = infinity;
  for (Index j = 0; j < effort_max_.size(); ++j) {
    const double limit = effort_max_[j] - rise_[j];
    for (Index k = 0; k < points - 1; ++k) {
      const double rest = without_(j, k), slope = (rest - with_rate_(j, k)) / rate;  // M w
      if (slope == 0.0) continue;
      const double a = (rest - limit) / slope, b = (rest + limit) / slope;
      low = std::max(low, std::min(a, b));
      high = std::min(high, std::max(a, b));
    }
  }
  return {low, high};
}

std::optional<double> BrakingRate::find(const VectorXd& q, const VectorXd& w,
                                        double least_utilisation) {
  const double largest = upper_rate(w);
  utilisation_ = 0.0;
  if (effort_max_.size() == 0) return largest;
  double rate = std::min(last_, largest);
  if (w.cwiseAbs().maxCoeff() < resting_speed) rate = largest;
  std::optional<double> found;
  for (int i = 0; i < tries_max; ++i) {
    const double used = evaluate(q, w, rate);
    if (used <= 1.0) {
      if (!found || rate > *found) found = rate;
      if (used >= least_utilisation || rate >= largest) break;
    }
    const auto [low, high] = allowed_rates(rate);
    double next = std::min(below_largest * high, largest);
    if (low > next) next = 0.5 * (low + high);
    // a longer line reaches other postures, which may allow less
    if (used > 1.0 && next >= rate) next = 0.8 * rate;
    if (!(next > 0.0) || (found && next <= *found * 1.01)) break;
    rate = next;
  }
  if (found) last_ = *found;
  return found;
}

}  // namespace hamelin::control

#include "shield/move_time.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "shield/fail_safe.hpp"

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// By how much a torque may rise between the points of a move, from its second differences: twice
// what a parabola rises.
template <class Row>
double rise(const Row& torque) {
  double bend = 0.0;
  for (Index k = 1; k + 1 < torque.size(); ++k)
    bend = std::max(bend, std::abs(torque[k - 1] - 2.0 * torque[k] + torque[k + 1]));
  return 0.25 * bend;
}

}  // namespace

MoveTime::MoveTime(const model::Model& model, Limits limits)
    : model_(model),
      limits_(std::move(limits)),
      batch_(model),
      ws_(model),
      momentum_(VectorXd::Zero(model.dof())) {
  for (auto* x : {&q_, &v_, &a_, &torque_, &gravity_}) x->setZero(model.dof(), points);
}

double MoveTime::by_motion(const VectorXd& q, const VectorXd& way) {
  const auto largest = [&](const VectorXd& limit) {
    return limit.size() > 0 ? (way.array().abs() / limit.array()).maxCoeff() : 0.0;
  };
  double time =
      std::max({limits_.least_s, FailSafe::peak_velocity * largest(limits_.velocity_max),
                std::sqrt(FailSafe::peak_acceleration * largest(limits_.acceleration_max)),
                std::cbrt(FailSafe::peak_jerk * largest(limits_.jerk_max))});
  if (limits_.torque_rate > 0.0) {
    dynamics::momentum(model_, ws_, q, way, momentum_);
    time = std::max(time, std::cbrt(FailSafe::peak_jerk * momentum_.cwiseAbs().maxCoeff() /
                                    limits_.torque_rate));
  }
  return time;
}

// docs/theory.md (14.25)
std::optional<double> MoveTime::find(const VectorXd& q, const VectorXd& way) {
  const double time = by_motion(q, way);
  if (limits_.effort_max.size() == 0) return time;
  for (Index k = 0; k < points; ++k) {
    const auto at = FailSafe::profile(static_cast<double>(k) / static_cast<double>(points - 1));
    q_.col(k) = q + at.position * way;
    v_.col(k).setZero();
    a_.col(k).setZero();
  }
  dynamics::inverse_dynamics(model_, batch_, q_, v_, a_, gravity_);
  for (Index k = 0; k < points; ++k) {
    const auto at = FailSafe::profile(static_cast<double>(k) / static_cast<double>(points - 1));
    v_.col(k) = at.velocity * way;
    a_.col(k) = at.acceleration * way;
  }
  dynamics::inverse_dynamics(model_, batch_, q_, v_, a_, torque_);
  double least = time * time;
  for (Index j = 0; j < q.size(); ++j) {
    const double moving_rise = rise(torque_.row(j) - gravity_.row(j)),
                 gravity_rise = rise(gravity_.row(j));
    for (Index k = 0; k < points; ++k) {
      const double difference = torque_(j, k) - gravity_(j, k),
                   moving = difference + std::copysign(moving_rise, difference);
      const double left =
          limits_.effort_max[j] - gravity_rise - (moving > 0.0 ? gravity_(j, k) : -gravity_(j, k));
      if (left <= 0.0) return std::nullopt;
      least = std::max(least, std::abs(moving) / left);
    }
  }
  return std::sqrt(least);
}

}  // namespace hamelin::control

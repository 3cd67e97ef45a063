#include "shield/certified_path.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

constexpr double e_number = 2.718281828459045;
// The deviation has faded after so many of its time constants.
constexpr double faded = 8.0;
constexpr int tries = 6;
constexpr double below_allowed = 0.97;

}  // namespace

PathStop::PathStop(Index dof) {
  for (auto* x : {&e_, &slope_, &widest_, &end_, &effort_, &v_, &a_}) x->setZero(dof);
}

PathStop::Place PathStop::place_at(double time_s, double beta) const {
  const double braking = beta > 0.0 ? std::min(time_s, from_.rate / beta) : time_s;
  return {from_.time_s + braking * (from_.rate - 0.5 * beta * braking),
          std::max(0.0, from_.rate - beta * braking)};
}

// docs/theory.md (14.32): |ρ² (A u + B s²) − β A s + g| within the limits, where A, B and g are the
// path's inertia, bias and gravity at a node, s its speed there and u its rate.
double PathStop::allowed_at(Index node, double rate, double u) const {
  const timing::TimedPath& motion = path_->motion;
  const double speed = motion.speed[node], square = rate * rate;
  double most = std::numeric_limits<double>::infinity();
  for (Index j = 0; j < effort_.size(); ++j) {
    const double a = motion.inertia(j, node),
                 rest = square * (a * u + motion.bias(j, node) * speed * speed) +
                        motion.gravity(j, node),
                 slope = a * speed;
    if (slope > 0.0)
      most = std::min(most, (rest + effort_[j]) / slope);
    else if (slope < 0.0)
      most = std::min(most, (rest - effort_[j]) / slope);
  }
  return std::max(0.0, most);
}

double PathStop::allowed(double beta) const {
  const timing::TimedPath& motion = path_->motion;
  double most = beta, square = from_.rate * from_.rate, theta = from_.time_s;
  for (Index k = first_; k + 1 < motion.nodes(); ++k) {
    // ρ² falls linearly with θ
    const double next = square - 2.0 * beta * (motion.time_s[k + 1] - theta),
                 before = std::sqrt(square), behind = std::sqrt(std::max(0.0, next));
    for (const double rate : {before, behind})
      for (const Index node : {k, k + 1})
        most = std::min(most, allowed_at(node, rate, motion.rate[k]));
    if (next <= 0.0) break;
    theta = motion.time_s[k + 1];
    square = next;
  }
  return most;
}

void PathStop::set(const CertifiedPath& path, const Place& from, const VectorXd& e,
                   const VectorXd& e_rate, const Bounds& bounds) {
  path_ = &path;
  from_ = from;
  e_ = e;
  slope_ = e_rate + fade_rate * e;
  fade_acceleration_ =
      fade_rate * (fade_rate * e.cwiseAbs() + 2.0 * e_rate.cwiseAbs()).maxCoeff();
  effort_ = bounds.effort_max;
  if (effort_.size() > 0) effort_ -= fade_acceleration_ * path.mass;
  const timing::TimedPath& motion = path.motion;
  const double end = motion.duration_s();
  cursor_ = {};
  motion.at(from.time_s, end_, v_, a_, cursor_);
  widest_ = e.cwiseAbs() + slope_.cwiseAbs() / (fade_rate * e_number);
  first_ = cursor_.node;
  beta_ = bounds.rate_max;
  for (int i = 0; i < tries && beta_ > 0.0; ++i) {
    const double most = allowed(beta_);
    if (most >= beta_) break;
    beta_ = i + 1 < tries ? below_allowed * most : 0.0;  // the path's own way to rest
  }
  const double left = end - from.time_s, square = from.rate * from.rate - 2.0 * beta_ * left;
  if (!(from.rate > 0.0))
    braking_s_ = 0.0;
  else if (square > 0.0 || beta_ == 0.0)  // the path ends before
    braking_s_ = 2.0 * left / (from.rate + std::sqrt(std::max(0.0, square)));
  else
    braking_s_ = from.rate / beta_;
  duration_s_ = braking_s_ + faded / fade_rate;
  timing::TimedPath::Cursor last = cursor_;
  motion.at(place_at(braking_s_, beta_).time_s, end_, v_, a_, last);
  last_ = last.node;
}

void PathStop::path_at(double time_s, VectorXd& q, VectorXd& v, VectorXd& a) const {
  const Place place = place_at(std::min(time_s, braking_s_), beta_);
  path_->motion.at(place.time_s, q, v, a, cursor_);
  if (time_s >= braking_s_) {
    v.setZero();
    a.setZero();
    return;
  }
  a = place.rate * place.rate * a - beta_ * v;
  v *= place.rate;
}

void PathStop::at(double time_s, VectorXd& q, VectorXd& v) const {
  path_at(time_s, q, v, a_);
  if (time_s >= duration_s_) return;
  const double decay = std::exp(-fade_rate * time_s);
  q += decay * (e_ + time_s * slope_);
  v += decay * (slope_ - fade_rate * (e_ + time_s * slope_));
}

}  // namespace hamelin::control

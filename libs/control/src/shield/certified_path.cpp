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
constexpr std::size_t pieces_max = 4096;

}  // namespace

PathStop::PathStop(Index dof) {
  for (auto* x : {&e_, &slope_, &widest_, &end_, &effort_, &v_, &a_}) x->setZero(dof);
  pieces_.reserve(pieces_max);
  pieces_.push_back({});
}

PathStop::Piece PathStop::place_at(double time_s) const {
  const auto next = std::upper_bound(pieces_.begin() + 1, pieces_.end(), time_s,
                                     [](double t, const Piece& p) { return t < p.time_s; });
  const Piece& piece = *(next - 1);
  const double dt = time_s - piece.time_s;
  return {time_s, piece.theta_s + dt * (piece.rate - 0.5 * piece.braking * dt),
          std::max(0.0, piece.rate - piece.braking * dt), piece.braking};
}

// docs/theory.md (14.32): |ρ² (A u + B s²) − β A s + g| within the limits, where A, B and g are the
// path's inertia, bias and gravity at a node, s its speed there and u its rate.
void PathStop::bound_by(Index node, double u, double square, double ahead_s, double& most) const {
  const timing::TimedPath& motion = path_->motion;
  const double speed = motion.speed[node];
  for (Index j = 0; j < effort_.size(); ++j) {
    const double a = motion.inertia(j, node),
                 dynamic = a * u + motion.bias(j, node) * speed * speed,
                 rest = square * dynamic + motion.gravity(j, node),
                 slope = 2.0 * ahead_s * dynamic + a * speed;
    if (slope > 0.0)
      most = std::min(most, (rest + effort_[j]) / slope);
    else if (slope < 0.0)
      most = std::min(most, (rest - effort_[j]) / slope);
  }
}

double PathStop::allowed(Index interval, double theta_s, double square) const {
  const timing::TimedPath& motion = path_->motion;
  double most = rate_max_;
  bound_by(interval, motion.rate[interval], square, 0.0, most);
  bound_by(interval + 1, motion.rate[interval], square, motion.time_s[interval + 1] - theta_s,
           most);
  return std::max(0.0, most);
}

void PathStop::set(const CertifiedPath& path, const Place& from, const VectorXd& e,
                   const VectorXd& e_rate, const Bounds& bounds) {
  path_ = &path;
  e_ = e;
  slope_ = e_rate + fade_rate * e;
  widest_ = e.cwiseAbs() + slope_.cwiseAbs() / (fade_rate * e_number);
  fade_acceleration_ = fade_rate * (fade_rate * e.cwiseAbs() + 2.0 * e_rate.cwiseAbs()).maxCoeff();
  effort_ = bounds.effort_max;
  if (effort_.size() > 0) effort_ -= fade_acceleration_ * path.mass;
  rate_max_ = bounds.rate_max;
  const timing::TimedPath& motion = path.motion;
  cursor_ = {};
  motion.at(from.time_s, end_, v_, a_, cursor_);
  first_ = last_ = cursor_.node;
  pieces_.clear();
  brake(from);
  duration_s_ = braking_s_ + faded / fade_rate;
  timing::TimedPath::Cursor last = cursor_;
  motion.at(pieces_.back().theta_s, end_, v_, a_, last);
}

// Interval by interval, as hard as torques allow: ρ² falls linearly with θ.
void PathStop::brake(const Place& from) {
  const timing::TimedPath& motion = path_->motion;
  double t = 0.0, theta = from.time_s, square = from.rate * from.rate;
  for (Index k = first_; square > 0.0 && k + 1 < motion.nodes(); ++k) {
    const double beta = allowed(k, theta, square), rate = std::sqrt(square),
                 length = motion.time_s[k + 1] - theta;
    pieces_.push_back({t, theta, rate, beta});
    last_ = k;
    const double next = square - 2.0 * beta * length;
    if (next <= 0.0) {  // comes to rest on this interval
      t += rate / beta;
      theta += 0.5 * square / beta;
      square = 0.0;
    } else {
      t += 2.0 * length / (rate + std::sqrt(next));
      theta = motion.time_s[k + 1];
      square = next;
    }
  }
  braking_s_ = t;
  pieces_.push_back({t, theta, 0.0, 0.0});
}

void PathStop::path_at(double time_s, VectorXd& q, VectorXd& v, VectorXd& a) const {
  const Piece place = place_at(std::min(time_s, braking_s_));
  path_->motion.at(place.theta_s, q, v, a, cursor_);
  if (time_s >= braking_s_) {
    v.setZero();
    a.setZero();
    return;
  }
  a = place.rate * place.rate * a - place.braking * v;
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

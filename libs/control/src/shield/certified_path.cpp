#include "shield/certified_path.hpp"

#include <algorithm>
#include <cmath>

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

constexpr double e_number = 2.718281828459045;
// The deviation has faded after so many of its time constants.
constexpr double faded = 8.0;
constexpr std::size_t pieces_max = 4096;
// Braking is planned for this much of the path; a stop that is not at rest there does not brake
// behind it [s].
constexpr double looked_ahead_s = 0.4;
// The share of torques that is used at the nodes of a path: they rise a little between them.
constexpr double at_nodes = 0.995;
// Bounds of ρ become tighter by each pass over the nodes.
constexpr int passes = 2;

}  // namespace

PathStop::PathStop(Index dof) {
  for (auto* x :
       {&e_, &slope_, &bend_, &widest_, &fade_, &end_, &effort_, &acceleration_, &v_, &a_})
    x->setZero(dof);
  square_ = bound_ = VectorXd::Zero(static_cast<Index>(pieces_max));
  pieces_.reserve(pieces_max);
  pieces_.push_back({});
}

PathStop::Piece PathStop::ahead(const Piece& piece, double dt) {
  return {piece.time_s + dt,
          piece.theta_s + dt * (piece.rate - dt * (0.5 * piece.braking + dt * piece.slope / 6.0)),
          std::max(0.0, piece.rate - dt * (piece.braking + 0.5 * dt * piece.slope)),
          piece.braking + dt * piece.slope, piece.slope};
}

PathStop::Piece PathStop::place_at(double time_s) const {
  const auto next = std::upper_bound(pieces_.begin() + 1, pieces_.end(), time_s,
                                     [](double t, const Piece& p) { return t < p.time_s; });
  return ahead(*(next - 1), time_s - (next - 1)->time_s);
}

// docs/theory.md (14.32): |ρ² (A u + B s²) − β A s + g| within the limits, where A, B and g are the
// path's inertia, bias and gravity at a node, s its speed there and u its rate.
void PathStop::bound_by(Index node, double u, double square, double ahead_s, double& most) const {
  const timing::TimedPath& motion = path_->motion;
  const double speed = motion.speed[node];
  const auto bound = [&](double a, double b, double g, double limit) {
    const double dynamic = a * u + b * speed * speed, rest = square * dynamic + g,
                 slope = 2.0 * ahead_s * dynamic + a * speed;
    if (slope > 0.0)
      most = std::min(most, (rest + limit) / slope);
    else if (slope < 0.0)
      most = std::min(most, (rest - limit) / slope);
  };
  for (Index j = 0; j < effort_.size(); ++j)
    bound(motion.inertia(j, node), motion.bias(j, node), motion.gravity(j, node), effort_[j]);
  for (Index j = 0; j < acceleration_.size(); ++j)
    bound(motion.tangent(j, node), motion.curvature(j, node), 0.0, acceleration_[j]);
}

double PathStop::allowed(Index interval, double theta_s, double square) const {
  const timing::TimedPath& motion = path_->motion;
  double most = rate_max_;
  bound_by(interval, motion.rate[interval], square, 0.0, most);
  bound_by(interval + 1, motion.rate_at_end(interval), square,
           motion.time_s[interval + 1] - theta_s, most);
  return std::max(0.0, most);
}

// docs/theory.md (14.33), (14.38)
void PathStop::set_deviation(const Deviation& deviation, bool jumps) {
  constexpr double w = fade_rate;
  e_ = deviation.e;
  slope_ = deviation.rate + w * e_;
  widest_ = e_.cwiseAbs() + slope_.cwiseAbs() / (w * e_number);
  if (jumps) {
    bend_.setZero();
    fade_ = w * (w * e_.cwiseAbs() + 2.0 * deviation.rate.cwiseAbs());
    return;
  }
  constexpr double square = 2.0 / (e_number * e_number);  // the most of x² e^{−x}/2
  bend_ = deviation.acceleration + 2.0 * w * deviation.rate + w * w * e_;
  widest_ += square / (w * w) * bend_.cwiseAbs();
  fade_ = deviation.acceleration.cwiseAbs() +
          w * (w * slope_ - 2.0 * bend_).cwiseAbs() / (w * e_number) + square * bend_.cwiseAbs();
}

void PathStop::set(const CertifiedPath& path, const Place& from, const Deviation& deviation,
                   double braking, const Bounds& bounds) {
  path_ = &path;
  const bool jumps = path.braking_ramp == 0.0;
  set_deviation(deviation, jumps);
  effort_ = at_nodes * bounds.effort_max;
  if (effort_.size() > 0) effort_.noalias() -= path.mass * fade_;
  acceleration_ = path.stop_acceleration;
  if (acceleration_.size() > 0) acceleration_ -= fade_;
  rate_max_ = bounds.rate_max;
  const timing::TimedPath& motion = path.motion;
  cursor_ = {};
  motion.at(from.time_s, end_, v_, a_, cursor_);
  first_ = last_ = cursor_.node;
  if (jumps)
    brake(from);
  else
    brake_with_ramps(from, braking);
  duration_s_ = braking_s_ + faded / fade_rate;
  timing::TimedPath::Cursor last = cursor_;
  motion.at(pieces_.back().theta_s, end_, v_, a_, last);
}

// Interval by interval, as hard as torques allow: ρ² falls linearly with θ.
void PathStop::brake(const Place& from) {
  const timing::TimedPath& motion = path_->motion;
  double t = 0.0, theta = from.time_s, square = from.rate * from.rate;
  pieces_.clear();
  ramp_s_ = 0.0;
  for (Index k = first_; square > 0.0 && k + 1 < motion.nodes(); ++k) {
    const double beta = allowed(k, theta, square), rate = std::sqrt(square),
                 length = motion.time_s[k + 1] - theta;
    pieces_.push_back({t, theta, rate, beta, 0.0});
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
  pieces_.push_back({t, theta, 0.0, 0.0, 0.0});
}

// docs/theory.md (14.39): ρ is bounded by what it is at first, and by what a pass has found.
void PathStop::brake_with_ramps(const Place& from, double braking) {
  const timing::TimedPath& motion = path_->motion;
  const double* const times = motion.time_s.data();
  const Index end = std::min(
      std::upper_bound(times + first_, times + motion.nodes(), from.time_s + looked_ahead_s) -
          times,
      motion.nodes() - 1);
  square_.segment(first_, end - first_ + 1).setConstant(from.rate * from.rate);
  for (int i = 0; i < passes; ++i) {
    set_bounds(from.rate, end);
    follow_bounds(from, braking, end);
  }
}

void PathStop::set_bounds(double rate, Index end) {
  const timing::TimedPath& motion = path_->motion;
  for (Index k = first_; k <= end; ++k) {
    double most = std::min(rate_max_, path_->braking_max[k]);
    bound_by(k, motion.rate_at(k), square_[k], 0.0, most);
    bound_[k] = std::max(0.0, most);
  }
  if (end + 1 < motion.nodes()) bound_[end] = 0.0;
  if (!(rate > 0.0)) return;
  for (Index k = end - 1; k >= first_; --k)  // so early that β can fall
    bound_[k] =
        std::min(bound_[k], bound_[k + 1] + path_->braking_ramp *
                                                (motion.time_s[k + 1] - motion.time_s[k]) / rate);
}

void PathStop::follow_bounds(const Place& from, double braking, Index end) {
  const timing::TimedPath& motion = path_->motion;
  const double ramp = path_->braking_ramp, step = motion.time_s[1] - motion.time_s[0];
  Piece at{0.0, from.time_s, from.rate, braking, 0.0};
  pieces_.clear();
  Index k = first_;
  double most = 0.0;
  bool to_rest = false;
  while (!to_rest && at.rate > 0.0 && at.theta_s < motion.duration_s() &&
         pieces_.size() + 2 < pieces_max) {
    last_ = k;
    most = std::max(most, at.braking);
    double dt = step;
    to_rest = at.braking * at.braking >= 0.999 * 2.0 * ramp * at.rate;
    if (to_rest) {
      at.slope = -0.5 * at.braking * at.braking / at.rate;  // to rest, where β is zero, too
      dt = 2.0 * at.rate / at.braking;
    } else {
      const double theta = at.theta_s + step * at.rate, half = 0.5 * ramp * step;
      Index next = k;
      while (next + 1 < end && motion.time_s[next + 1] <= theta) ++next;
      const double ends =
          std::sqrt(half * half + 2.0 * ramp * std::max(0.0, at.rate - 0.5 * step * at.braking)) -
          half;
      const double wanted = next + 1 <= end ? std::min(bound_[next], bound_[next + 1]) : 0.0;
      at.slope = (std::clamp(std::min(wanted, ends), std::max(0.0, at.braking - ramp * step),
                             at.braking + ramp * step) -
                  at.braking) /
                 step;
    }
    pieces_.push_back(at);
    at = ahead(at, dt);
    for (; k + 2 < motion.nodes() && motion.time_s[k + 1] <= at.theta_s; ++k)
      if (k + 1 <= end) square_[k + 1] = pieces_.back().rate * pieces_.back().rate;
  }
  last_ = k;
  if (k + 1 <= end) square_[k + 1] = pieces_.empty() ? 0.0 : std::pow(pieces_.back().rate, 2);
  ramp_s_ = most / ramp;
  braking_s_ = at.time_s;
  pieces_.push_back({at.time_s, at.theta_s, 0.0, 0.0, 0.0});
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
  const double t = time_s, decay = std::exp(-fade_rate * t);
  a_ = e_ + t * (slope_ + 0.5 * t * bend_);
  q += decay * a_;
  v += decay * (slope_ + t * bend_ - fade_rate * a_);
}

}  // namespace hamelin::control

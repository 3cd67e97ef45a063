#include "hamelin/control/certificate.hpp"

#include <algorithm>
#include <cmath>

#include "hamelin/core/numbers.hpp"
#include "hamelin/scene/levers.hpp"

namespace hamelin::control {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

// Largest chord of any point of a shape's axis, attained at an end: docs/theory.md (12.8).
double chord(const scene::Shapes& before, const scene::Shapes& after, std::size_t shape) {
  const Vector3d center = after.centers[shape] - before.centers[shape];
  if (!after.is_capsule(shape)) return center.norm();
  const Vector3d half = after.half_axes[shape] - before.half_axes[shape];
  return std::max((center - half).norm(), (center + half).norm());
}

}  // namespace

Certificate::Certificate(const model::Model& model, double limit, const scene::SelfField* self,
                         double self_limit, std::size_t obstacles_max)
    : model_(model),
      limit_(limit),
      self_(self),
      self_limit_(self_limit),
      levers_(std::make_unique<scene::Levers>(model, self)),
      arm_(model) {
  appearing_.reserve(obstacles_max);
  movers_.reserve(obstacles_max);
  const Index n = model.dof();
  for (auto* x : {&q_, &dq_, &stray_, &curvature_, &rest_, &q_middle_, &rate_}) x->setZero(n);
}

Certificate::~Certificate() = default;

Eigen::MatrixXd::ConstRowXpr Certificate::lever(Subject subject) const {
  const Eigen::MatrixXd& all = subject.is_pair ? levers_->pairs() : levers_->shapes();
  return all.row(static_cast<Index>(subject.index));
}

Certificate::Verdict Certificate::check(dynamics::Workspace& ws,
                                        const scene::Environment& environment, const Node& from,
                                        const Node& to) {
  environment_ = &environment;
  q_ = from.q;
  dq_ = to.q - from.q;
  moment_ = from.moment;
  ahead_ = to.moment.now_s == from.moment.now_s;
  h_ = to.moment.now_s + to.moment.ahead_s - from.moment.now_s - from.moment.ahead_s;
  stray_ = 0.25 * h_ * (to.v - from.v).cwiseAbs();  // docs/theory.md (12.2)
  levers_->extend_travel(from.q, stray_);
  levers_->extend_travel(to.q, stray_);
  levers_->curvature(dq_, curvature_);
  rest_ = 0.125 * curvature_ + stray_;
  find_movers(from, to);
  contact_ = false;
  pieces_ = 0;

  Verdict verdict;
  verdict.certified = true;
  verdict.margin_m = from.clearance.empty() ? self_limit_ : limit_;
  const auto include = [&](Subject subject, double bound, double d, double d_next) {
    if (bound <= 0.0) bound = std::min(far_, prove(ws, subject, {0.0, 1.0, d, d_next}));
    verdict.margin_m = std::min(verdict.margin_m, bound);
    if (!(bound > 0.0)) verdict.certified = false;
  };
  for (std::size_t s = 0; s < from.clearance.size(); ++s) {
    const Subject subject{s, false};
    const double d = appearing_.empty() ? from.clearance[s]
                                        : clearance_of_appearing(from.arm.single(s), from.moment,
                                                                 from.clearance[s]);
    include(subject, bound_on_step(from, to, s, d, to.clearance[s]), d, to.clearance[s]);
  }
  far_ = infinity;
  for (std::size_t k = 0; k < from.pairs.size(); ++k) {
    const Subject subject{k, true};
    const bool touched = contact_;
    // docs/theory.md (12.12): the bound that needs no posture usually suffices
    const double longest = lever(subject).dot(dq_.cwiseAbs()), rest = lever(subject).dot(stray_);
    include(subject, 0.5 * (from.pairs[k] + to.pairs[k] - longest) - rest, from.pairs[k],
            to.pairs[k]);
    if (contact_ && !touched) verdict.self_pair = static_cast<int>(k);
  }
  verdict.contact = contact_;
  return verdict;
}

void Certificate::find_movers(const Node& from, const Node& to) {
  appearing_.clear();
  movers_.clear();
  for (std::size_t k = 0; k < environment_->obstacles().size(); ++k) {
    const auto& obstacle = environment_->obstacles()[k];
    if (!scene::exists(obstacle, to.moment.now_s)) continue;
    if (!scene::exists(obstacle, from.moment.now_s)) appearing_.push_back(k);
    if (!environment_->moves(k)) continue;
    const scene::Placed at_from = scene::placed_at(obstacle, from.moment),
                        at_to = scene::placed_at(obstacle, to.moment);
    const double ball = scene::bounding_radius(obstacle),
                 speed =
                     ahead_ ? scene::max_speed(obstacle, from.moment) : scene::max_speed(obstacle);
    movers_.push_back({h_ * speed, at_from.pose.p(), at_to.pose.p(), ball + at_from.nearer_m,
                       ball + at_to.nearer_m});
  }
}

// docs/theory.md (12.7), (12.13)
double Certificate::bound_on_step(const Node& from, const Node& to, std::size_t shape, double d,
                                  double d_next) {
  const double moved = chord(from.arm, to.arm, shape),
               rest = levers_->shapes().row(static_cast<Index>(shape)).dot(rest_);
  const double standing = 0.5 * (d + d_next - moved) - rest;
  const double own =
      from.arm.radii[shape] + (from.arm.is_capsule(shape) ? from.arm.half_axes[shape].norm() : 0.0);
  double bound = standing;
  travel_ = 0.0;
  far_ = infinity;
  for (const Mover& mover : movers_) {
    const double apart = (from.arm.centers[shape] - mover.from).norm() - mover.ball_from - own,
                 apart_next = (to.arm.centers[shape] - mover.to).norm() - mover.ball_to - own;
    const double by_balls =
        0.5 * (std::max(d, apart) + std::max(d_next, apart_next) - moved - mover.travel) - rest;
    bound = std::min(bound, by_balls);
    if (by_balls <= 0.0)
      travel_ = std::max(travel_, mover.travel);
    else
      far_ = std::min(far_, by_balls);
  }
  return bound;
}

scene::Moment Certificate::moment_at(double s) const {
  if (ahead_) return {moment_.now_s, moment_.ahead_s + s * h_};
  return {moment_.now_s + s * h_, moment_.ahead_s};
}

double Certificate::longest_path(const VectorXd& dq) const {
  double longest = 0.0;
  for (Index s = 0; s < levers_->shapes().rows(); ++s)
    longest = std::max(longest, levers_->shapes().row(s).dot(dq.cwiseAbs()));
  return longest;
}

double Certificate::clearance_of_appearing(const scene::Shapes& shape, const scene::Moment& moment,
                                           double clearance) const {
  for (const std::size_t k : appearing_)
    clearance = std::min(clearance, environment_->clearance_to(k, shape, moment, clearance));
  return clearance;
}

double Certificate::speed(const dynamics::Workspace& ws, Subject subject) const {
  double fastest = 0.0;
  const scene::Shapes arm = arm_.view();
  const auto consider = [&](std::size_t s) {
    const int link = model_.shapes()[s].link;
    const auto of = [&](const Vector3d& point) {
      fastest = std::max(fastest, dynamics::point_velocity(model_, ws, link, point, rate_).norm());
    };
    if (arm.is_capsule(s)) {
      of(arm.from(s));
      of(arm.to(s));
    } else {
      of(arm.centers[s]);
    }
  };
  if (!subject.is_pair) {
    consider(subject.index);
    return fastest;
  }
  const auto& pair = self_->pairs()[subject.index];
  const auto &a = self_->parts()[static_cast<std::size_t>(pair.part_a)],
             &b = self_->parts()[static_cast<std::size_t>(pair.part_b)];
  for (const int s : (a.body > b.body ? a : b).shapes) consider(static_cast<std::size_t>(s));
  return fastest;
}

double Certificate::clearance_at(Subject subject, double s) {
  const scene::Shapes shape = subject.is_pair ? arm_.view() : arm_.view().single(subject.index);
  const scene::Moment moment = moment_at(s);
  const double clearance = subject.is_pair ? self_->distance(subject.index, shape, self_limit_)
                                           : environment_->clearance(shape, moment, limit_);
  contact_ = contact_ || clearance <= 0.0;
  return subject.is_pair ? clearance : clearance_of_appearing(shape, moment, clearance);
}

// docs/theory.md (12.9), (12.10)
double Certificate::prove(dynamics::Workspace& ws, Subject subject, const Piece& piece) {
  if (++pieces_ > pieces_max) return 0.0;
  const double middle = piece.at + 0.5 * piece.width;
  q_middle_ = q_ + middle * dq_;
  rate_ = dq_;
  double obstacle_travel = travel_;
  if (subject.is_pair) {
    const auto& pair = self_->pairs()[subject.index];
    const int inner = std::min(self_->parts()[static_cast<std::size_t>(pair.part_a)].body,
                               self_->parts()[static_cast<std::size_t>(pair.part_b)].body);
    rate_.head(inner + 1).setZero();  // in the frame of the inner part
    obstacle_travel = 0.0;
  }
  dynamics::forward_kinematics(model_, ws, q_middle_);
  arm_.place(model_, ws);
  const double kappa = lever(subject).dot(curvature_);
  const double path = piece.width * (speed(ws, subject) + obstacle_travel) +
                      0.25 * piece.width * piece.width * kappa;
  const double bound = 0.5 * (piece.from + piece.to - path) - lever(subject).dot(stray_);
  if (bound > 0.0 || path <= resolution_m) return bound;
  const double clearance = clearance_at(subject, middle);
  if (clearance <= 0.0) return clearance;
  const double half = 0.5 * piece.width;
  const double first = prove(ws, subject, {piece.at, half, piece.from, clearance});
  return std::min(first, prove(ws, subject, {middle, half, clearance, piece.to}));
}

}  // namespace hamelin::control

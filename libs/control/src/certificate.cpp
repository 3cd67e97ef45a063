#include "hamelin/control/certificate.hpp"

#include <algorithm>
#include <cmath>

namespace hamelin::control {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

bool slides(const model::Model& model, Index joint) {
  return model.robot().links[static_cast<std::size_t>(joint)].joint.type == model::JointType::prismatic;
}

// How far the ends of a shape's axis are moved between two placements: no point of it moves farther.
double way(const scene::Shapes& before, const scene::Shapes& after, std::size_t shape) {
  const Vector3d center = after.centers[shape] - before.centers[shape];
  if (!after.is_capsule(shape)) return center.norm();
  const Vector3d half = after.half_axes[shape] - before.half_axes[shape];
  return std::max((center - half).norm(), (center + half).norm());
}

}  // namespace

Certificate::Certificate(const model::Model& model, const scene::Environment& environment, double limit,
                         const scene::SelfField* self, double self_limit)
    : model_(model),
      environment_(environment),
      limit_(limit),
      self_(self),
      self_limit_(self_limit),
      hop_(VectorXd::Zero(model.dof())),
      travel_(VectorXd::Zero(model.dof())),
      lever_(Eigen::MatrixXd::Zero(static_cast<Index>(model.shapes().size()), model.dof())),
      pair_lever_(Eigen::MatrixXd::Zero(self != nullptr ? static_cast<Index>(self->pairs().size()) : 0, model.dof())),
      arm_(model) {
  const Index n = model.dof();
  for (auto* x : {&q_, &dq_, &stray_, &bend_, &rest_, &between_, &turning_}) x->setZero(n);
  appearing_.reserve(environment.obstacles().size());
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, q_);
  for (Index j = 0; j < n; ++j) {
    const auto at = static_cast<std::size_t>(j);
    if (j > 0) hop_[j] = (ws.frames[at].p - ws.frames[at - 1].p).norm();
    const auto& joint = model.robot().links[at].joint;
    if (slides(model, j))
      travel_[j] = std::max(std::abs(joint.lower.value_or(0.0)), std::abs(joint.upper.value_or(0.0)));
  }
  set_levers();
}

// Successive joint frames keep their distance (but for prismatic travel), so sums of them bound every lever.
void Certificate::set_levers() {
  for (std::size_t s = 0; s < model_.shapes().size(); ++s) {
    const auto& shape = model_.shapes()[s];
    double length = std::max((shape.center - shape.half_axis).norm(), (shape.center + shape.half_axis).norm());
    for (Index j = shape.link; j >= 0; --j) {
      lever_(static_cast<Index>(s), j) = slides(model_, j) ? 1.0 : length;
      length += hop_[j] + travel_[j];
    }
  }
  for (Index k = 0; k < pair_lever_.rows(); ++k) {
    const auto& pair = self_->pairs()[static_cast<std::size_t>(k)];
    const auto* inner = &self_->parts()[static_cast<std::size_t>(pair.part_a)];
    const auto* outer = &self_->parts()[static_cast<std::size_t>(pair.part_b)];
    if (inner->body > outer->body) std::swap(inner, outer);
    for (int j = inner->body + 1; j <= outer->body; ++j)
      for (const int s : outer->shapes) pair_lever_(k, j) = std::max(pair_lever_(k, j), lever_(s, j));
  }
}

void Certificate::follow_travel(const VectorXd& q) {
  bool farther = false;
  for (Index j = 0; j < q.size(); ++j)
    if (slides(model_, j) && std::abs(q[j]) + stray_[j] > travel_[j]) {
      travel_[j] = 2.0 * (std::abs(q[j]) + stray_[j]);
      farther = true;
    }
  if (farther) set_levers();
}

Certificate::Verdict Certificate::check(dynamics::Workspace& ws, const Node& from, const Node& to) {
  q_ = from.q;
  dq_ = to.q - from.q;
  time_s_ = from.time_s;
  h_ = to.time_s - from.time_s;
  stray_ = 0.25 * h_ * (to.v - from.v).cwiseAbs();
  follow_travel(from.q);
  follow_travel(to.q);
  double turned = 0.0;
  for (Index j = 0; j < dq_.size(); ++j) {
    const double own = std::abs(dq_[j]), turns = slides(model_, j) ? 0.0 : own;
    bend_[j] = own * (turns + 2.0 * turned);
    turned += turns;
  }
  rest_ = 0.125 * bend_ + stray_;
  obstacle_way_ = 0.0;
  appearing_.clear();
  for (std::size_t k = 0; k < environment_.obstacles().size(); ++k) {
    const auto& obstacle = environment_.obstacles()[k];
    if (!scene::exists(obstacle, to.time_s)) continue;
    obstacle_way_ = std::max(obstacle_way_, h_ * scene::max_speed(obstacle));
    if (!scene::exists(obstacle, from.time_s)) appearing_.push_back(k);
  }
  contact_ = false;
  looks_ = 0;

  Verdict verdict;
  verdict.margin_m = from.clearance.empty() ? self_limit_ : limit_;
  const auto settle = [&](Subject subject, double bound, double d, double d_next) {
    if (bound <= 0.0) bound = prove(ws, subject, {0.0, 1.0, d, d_next});
    verdict.margin_m = std::min(verdict.margin_m, bound);
    if (!(bound > 0.0)) verdict.certified = false;
  };
  for (std::size_t s = 0; s < from.clearance.size(); ++s) {
    const Subject subject{s, false};
    const double d = appearing_.empty() ? from.clearance[s]
                                        : clearance_of_appearing(from.arm.only(s), from.time_s, from.clearance[s]);
    const double rest = lever(subject).dot(rest_);
    settle(subject, 0.5 * (d + to.clearance[s] - way(from.arm, to.arm, s) - obstacle_way_) - rest, d, to.clearance[s]);
  }
  for (std::size_t k = 0; k < from.pairs.size(); ++k) {
    const Subject subject{k, true};
    const bool touched = contact_;
    // first with the longest way there can be: mostly that is enough
    const double longest = lever(subject).dot(dq_.cwiseAbs()), rest = lever(subject).dot(stray_);
    settle(subject, 0.5 * (from.pairs[k] + to.pairs[k] - longest) - rest, from.pairs[k], to.pairs[k]);
    if (contact_ && !touched) verdict.self_pair = static_cast<int>(k);
  }
  verdict.contact = contact_;
  return verdict;
}

double Certificate::clearance_of_appearing(const scene::Shapes& shape, double time_s, double clearance) const {
  for (const std::size_t k : appearing_)
    clearance = std::min(clearance, environment_.clearance_to(k, shape, time_s, clearance));
  return clearance;
}

double Certificate::speed(const dynamics::Workspace& ws, Subject subject) const {
  double fastest = 0.0;
  const scene::Shapes arm = arm_.view();
  const auto consider = [&](std::size_t s) {
    const int link = model_.shapes()[s].link;
    const auto of = [&](const Vector3d& point) {
      fastest = std::max(fastest, dynamics::point_velocity(model_, ws, link, point, turning_).norm());
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

double Certificate::clearance_at(Subject subject, double at) {
  const scene::Shapes shape = subject.is_pair ? arm_.view() : arm_.view().only(subject.index);
  const double time_s = time_s_ + at * h_;
  const double there = subject.is_pair ? self_->distance(subject.index, shape, self_limit_)
                                       : environment_.clearance(shape, time_s, limit_);
  contact_ = contact_ || there <= 0.0;
  return subject.is_pair ? there : clearance_of_appearing(shape, time_s, there);
}

// The way of the middle's speed and of what that can change by on a piece of width w is w |c'| + w² κ/4.
double Certificate::prove(dynamics::Workspace& ws, Subject subject, const Piece& piece) {
  if (++looks_ > looks_max) return 0.0;
  const double middle = piece.at + 0.5 * piece.width;
  between_ = q_ + middle * dq_;
  turning_ = dq_;
  double obstacle_way = obstacle_way_;
  if (subject.is_pair) {
    const auto& pair = self_->pairs()[subject.index];
    const int inner = std::min(self_->parts()[static_cast<std::size_t>(pair.part_a)].body,
                               self_->parts()[static_cast<std::size_t>(pair.part_b)].body);
    turning_.head(inner + 1).setZero();
    obstacle_way = 0.0;
  }
  dynamics::forward_kinematics(model_, ws, between_);
  arm_.place(model_, ws);
  const double way =
      piece.width * (speed(ws, subject) + obstacle_way) + 0.25 * piece.width * piece.width * lever(subject).dot(bend_);
  const double bound = 0.5 * (piece.from + piece.to - way) - lever(subject).dot(stray_);
  if (bound > 0.0 || way <= resolution_m) return bound;
  const double there = clearance_at(subject, middle);
  if (there <= 0.0) return there;
  const double half = 0.5 * piece.width;
  const double first = prove(ws, subject, {piece.at, half, piece.from, there});
  return std::min(first, prove(ws, subject, {middle, half, there, piece.to}));
}

}  // namespace hamelin::control

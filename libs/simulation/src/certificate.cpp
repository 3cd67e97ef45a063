#include "certificate.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace hamelin::simulation {

Certificate::Certificate(const model::Model& model, const scene::Environment& environment, double limit,
                         const scene::SelfField* self, double self_limit)
    : model_(model),
      environment_(environment),
      limit_(limit),
      self_(self),
      self_limit_(self_limit),
      travel_(model.dof()),
      between_(model.dof()),
      centers_(model.spheres().size()) {
  const int n = model.dof();
  // Successive joint frames keep their distance (but for prismatic travel), so sums of them bound every lever.
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, Eigen::VectorXd::Zero(n));
  std::vector<double> hop(static_cast<std::size_t>(n), 0.0);
  for (int j = 1; j < n; ++j) {
    const auto& joint = model.robot().links[static_cast<std::size_t>(j)].joint;
    const auto at = static_cast<std::size_t>(j);
    hop[at] = (ws.frames[at].p - ws.frames[at - 1].p).norm();
    if (joint.type == model::JointType::prismatic)
      hop[at] += std::max(std::abs(joint.lower.value_or(-1.0)), std::abs(joint.upper.value_or(1.0)));
  }
  lever_ = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(model.spheres().size()), n);
  for (std::size_t s = 0; s < model.spheres().size(); ++s) {
    const auto& sphere = model.spheres()[s];
    radii_.push_back(sphere.radius);
    double length = sphere.center.norm();
    for (int j = sphere.link; j >= 0; --j) {
      const bool slides = model.robot().links[static_cast<std::size_t>(j)].joint.type == model::JointType::prismatic;
      lever_(static_cast<Eigen::Index>(s), j) = slides ? 1.0 : length;
      length += hop[static_cast<std::size_t>(j)];
    }
  }
  if (self_ != nullptr) {
    pair_lever_ = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(self_->pairs().size()), n);
    for (std::size_t k = 0; k < self_->pairs().size(); ++k) {
      const auto* inner = &self_->parts()[static_cast<std::size_t>(self_->pairs()[k].part_a)];
      const auto* outer = &self_->parts()[static_cast<std::size_t>(self_->pairs()[k].part_b)];
      if (inner->body > outer->body) std::swap(inner, outer);
      for (int j = inner->body + 1; j <= outer->body; ++j)
        for (const int s : outer->spheres) {
          auto& lever = pair_lever_(static_cast<Eigen::Index>(k), j);
          lever = std::max(lever, lever_(s, j));
        }
    }
  }
  for (const auto& obstacle : environment.obstacles())
    if (obstacle.motion)
      obstacle_speed_ = std::max(
          obstacle_speed_, 2.0 * std::numbers::pi * obstacle.motion->amplitude_m.norm() / obstacle.motion->period_s);
}

Certificate::Verdict Certificate::check(dynamics::Workspace& ws, const Eigen::VectorXd& q,
                                        const Eigen::VectorXd& q_next, const Eigen::VectorXd& v,
                                        const Eigen::VectorXd& v_next, double time_s, double h, const Clearances& from,
                                        const Clearances& to) {
  Verdict verdict;
  verdict.margin_m = from.spheres.empty() ? self_limit_ : limit_;
  contact_ = false;
  travel_ = (q_next - q).cwiseAbs() + 0.25 * h * (v_next - v).cwiseAbs();
  const Line line{&q, &q_next, time_s, h};
  const auto prove = [&](Subject subject, double d, double d_next, double length) {
    double margin = 0.5 * (d + d_next - length);
    if (margin <= 0.0) margin = bisect(ws, line, subject, 0.0, 1.0, d, d_next, length, 0);
    verdict.margin_m = std::min(verdict.margin_m, margin);
    if (margin <= 0.0) verdict.certified = false;
  };
  for (std::size_t s = 0; s < from.spheres.size(); ++s)
    prove({s, false}, from.spheres[s], to.spheres[s],
          lever_.row(static_cast<Eigen::Index>(s)).dot(travel_) + obstacle_speed_ * h);
  for (std::size_t k = 0; k < from.pairs.size(); ++k) {
    const bool touched = contact_;
    prove({k, true}, from.pairs[k], to.pairs[k], pair_lever_.row(static_cast<Eigen::Index>(k)).dot(travel_));
    if (contact_ && !touched) verdict.self_pair = static_cast<int>(k);
  }
  verdict.contact = contact_;
  return verdict;
}

double Certificate::clearance_at(dynamics::Workspace& ws, const Line& line, Subject subject, double at) {
  between_ = *line.q + at * (*line.q_next - *line.q);
  dynamics::forward_kinematics(model_, ws, between_);
  dynamics::sphere_centers(model_, ws, centers_);
  if (subject.is_pair) return self_->distance(subject.index, centers_, self_limit_);
  return environment_.clearance({&centers_[subject.index], 1}, {&radii_[subject.index], 1}, line.time_s + at * line.h,
                                limit_);
}

double Certificate::bisect(dynamics::Workspace& ws, const Line& line, Subject subject, double at, double width,
                           double from, double to, double length, int depth) {
  const double bound = 0.5 * (from + to - length);
  if (bound > 0.0) return bound;
  if (depth == max_depth) return bound;
  const double middle = clearance_at(ws, line, subject, at + 0.5 * width);
  if (middle <= 0.0) {
    contact_ = true;
    return middle;
  }
  const double first = bisect(ws, line, subject, at, 0.5 * width, from, middle, 0.5 * length, depth + 1);
  if (first <= 0.0) return first;
  return std::min(first, bisect(ws, line, subject, at + 0.5 * width, 0.5 * width, middle, to, 0.5 * length, depth + 1));
}

}  // namespace hamelin::simulation

#include "hamelin/scene/levers.hpp"

#include <algorithm>
#include <cmath>

#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::scene {

using Eigen::Index;
using Eigen::VectorXd;

Levers::Levers(const model::Model& model, const SelfField* self)
    : model_(model),
      self_(self),
      frame_distance_(VectorXd::Zero(model.dof())),
      travel_(VectorXd::Zero(model.dof())),
      shapes_(Eigen::MatrixXd::Zero(static_cast<Index>(model.shapes().size()), model.dof())),
      pairs_(Eigen::MatrixXd::Zero(self != nullptr ? static_cast<Index>(self->pairs().size()) : 0,
                                   model.dof())),
      tip_(VectorXd::Zero(model.dof())) {
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, VectorXd::Zero(model.dof()));
  for (Index j = 0; j < model.dof(); ++j) {
    const auto at = static_cast<std::size_t>(j);
    if (j > 0) frame_distance_[j] = (ws.frames[at].p - ws.frames[at - 1].p).norm();
    const auto& joint = model.robot().links[at].joint;
    if (slides(j))
      travel_[j] =
          std::max(std::abs(joint.lower.value_or(0.0)), std::abs(joint.upper.value_or(0.0)));
  }
  set();
}

void Levers::fill(int link, double length,
                  Eigen::Ref<Eigen::RowVectorXd, 0, Eigen::InnerStride<>> levers) const {
  for (Index j = link; j >= 0; --j) {
    levers[j] = slides(j) ? 1.0 : length;
    length += frame_distance_[j] + travel_[j];
  }
}

// docs/theory.md (12.3), (12.11)
void Levers::set() {
  for (std::size_t s = 0; s < model_.shapes().size(); ++s) {
    const auto& shape = model_.shapes()[s];
    fill(shape.link,
         std::max((shape.center - shape.half_axis).norm(), (shape.center + shape.half_axis).norm()),
         shapes_.row(static_cast<Index>(s)));
  }
  fill(model_.robot().tip.link, model_.tip_in_frame().p().norm(), tip_.transpose());
  for (Index k = 0; k < pairs_.rows(); ++k) {
    const auto& pair = self_->pairs()[static_cast<std::size_t>(k)];
    const auto* inner = &self_->parts()[static_cast<std::size_t>(pair.part_a)];
    const auto* outer = &self_->parts()[static_cast<std::size_t>(pair.part_b)];
    if (inner->body > outer->body) std::swap(inner, outer);
    for (int j = inner->body + 1; j <= outer->body; ++j)
      for (const int s : outer->shapes) pairs_(k, j) = std::max(pairs_(k, j), shapes_(s, j));
  }
}

double Levers::reach(const VectorXd& deviation) const {
  double most = 0.0;
  for (const Eigen::MatrixXd* levers : {&shapes_, &pairs_})
    for (Index s = 0; s < levers->rows(); ++s) most = std::max(most, levers->row(s).dot(deviation));
  return most;
}

void Levers::extend_travel(const VectorXd& q, const VectorXd& stray) {
  bool extended = false;
  for (Index j = 0; j < q.size(); ++j)
    if (slides(j) && std::abs(q[j]) + stray[j] > travel_[j]) {
      travel_[j] = 2.0 * (std::abs(q[j]) + stray[j]);
      extended = true;
    }
  if (extended) set();
}

void Levers::curvature(const VectorXd& dq, VectorXd& c) const {
  double rotation = 0.0;  // Σ |dq_i| of the revolute joints i < j
  for (Index j = 0; j < dq.size(); ++j) {
    const double own = std::abs(dq[j]), own_rotation = slides(j) ? 0.0 : own;
    c[j] = own * (own_rotation + 2.0 * rotation);
    rotation += own_rotation;
  }
}

}  // namespace hamelin::scene

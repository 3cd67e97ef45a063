#include "hamelin/optimal/world_clearance.hpp"

namespace hamelin::optimal {

using Eigen::Index;

WorldClearance::WorldClearance(const model::Model& model, control::WorldView& view)
    : model_(model),
      view_(view),
      shapes_(view.has_obstacles() ? static_cast<Index>(model.shapes().size()) : 0),
      pairs_(view.has_self() ? static_cast<Index>(view.self_field()->pairs().size()) : 0),
      rows_(points_per_shape * shapes_ + pairs_),
      ws_(model),
      contacts_(view.contacts_max()),
      pair_contacts_(view.self_contacts_max()),
      found_(static_cast<std::size_t>(shapes_)),
      row_(VectorXd::Zero(model.dof())) {}

void WorldClearance::evaluate(const VectorXd& q, VectorXd& distances, MatrixXd& gradients) {
  distances.head(points_per_shape * shapes_).setConstant(view_.influence_m());
  distances.tail(pairs_).setConstant(view_.self_influence_m());
  gradients.setZero();
  dynamics::forward_kinematics(model_, ws_, q);
  add_contacts(q, distances, gradients);
  add_pairs(q, distances, gradients);
}

// The distance changes with the point of the arm along the direction to it, docs/theory.md (18.7).
void WorldClearance::add_contacts(const VectorXd& q, VectorXd& distances, MatrixXd& gradients) {
  std::fill(found_.begin(), found_.end(), 0);
  const std::size_t count =
      std::min(contacts_.size(),
               view_.closest(q, view_.influence_m(), contacts_, 0.0, scene::Among::standing));
  for (std::size_t i = 0; i < count; ++i) {
    const scene::Contact& contact = contacts_[i];
    Index& found = found_[static_cast<std::size_t>(contact.sphere)];
    if (found == points_per_shape) continue;
    const Index row = points_per_shape * contact.sphere + found++;
    distances[row] = contact.distance;
    const int link = model_.shapes()[static_cast<std::size_t>(contact.sphere)].link;
    dynamics::point_jacobian_transpose(model_, ws_, link, contact.arm_point, contact.direction,
                                       row_);
    gradients.col(row) = row_;
  }
}

void WorldClearance::add_pairs(const VectorXd& q, VectorXd& distances, MatrixXd& gradients) {
  const std::size_t count = std::min(
      pair_contacts_.size(), view_.closest_self(q, view_.self_influence_m(), pair_contacts_));
  const auto link_of = [&](int shape) {
    return model_.shapes()[static_cast<std::size_t>(shape)].link;
  };
  for (std::size_t i = 0; i < count; ++i) {
    const scene::SelfContact& contact = pair_contacts_[i];
    const Index row = points_per_shape * shapes_ + contact.pair;
    distances[row] = contact.distance;
    dynamics::point_jacobian_transpose(model_, ws_, link_of(contact.sphere_a), contact.point_a,
                                       contact.direction, row_);
    gradients.col(row) = row_;
    if (contact.sphere_b < 0) continue;  // the base
    dynamics::point_jacobian_transpose(model_, ws_, link_of(contact.sphere_b), contact.point_b,
                                       contact.direction, row_);
    gradients.col(row) -= row_;
  }
}

}  // namespace hamelin::optimal

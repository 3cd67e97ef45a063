#include "hamelin/optimal/world_clearance.hpp"

namespace hamelin::optimal {

using Eigen::Index;

WorldClearance::WorldClearance(const model::Model& model, control::WorldView& view)
    : model_(model),
      view_(view),
      shapes_(view.has_obstacles() ? static_cast<Index>(model.shapes().size()) : 0),
      pairs_(view.has_self() ? static_cast<Index>(view.self_field()->pairs().size()) : 0),
      rows_(points_per_shape * shapes_ + pairs_),
      far_(rows_),
      ws_(model),
      contacts_(view.contacts_max()),
      pair_contacts_(view.self_contacts_max()),
      found_(static_cast<std::size_t>(shapes_)),
      gradient_(VectorXd::Zero(model.dof())),
      second_(gradient_) {
  far_.head(points_per_shape * shapes_).setConstant(view.influence_m());
  far_.tail(pairs_).setConstant(view.self_influence_m());
}

void WorldClearance::evaluate(const VectorXd& q, NearDistances& near) {
  near.clear();
  dynamics::forward_kinematics(model_, ws_, q);
  add_contacts(q, near);
  add_pairs(q, near);
}

// The distance changes with the point of the arm along the direction to it, docs/theory.md (18.7).
void WorldClearance::add_contacts(const VectorXd& q, NearDistances& near) {
  std::fill(found_.begin(), found_.end(), 0);
  const std::size_t count =
      std::min(contacts_.size(),
               view_.closest(q, view_.influence_m(), contacts_, 0.0, scene::Among::standing));
  for (std::size_t i = 0; i < count; ++i) {
    const scene::Contact& contact = contacts_[i];
    Index& found = found_[static_cast<std::size_t>(contact.sphere)];
    if (found == points_per_shape) continue;
    const Index row = points_per_shape * contact.sphere + found++;
    const int link = model_.shapes()[static_cast<std::size_t>(contact.sphere)].link;
    dynamics::point_jacobian_transpose(model_, ws_, link, contact.arm_point, contact.direction,
                                       gradient_);
    near.add(row, contact.distance, gradient_);
  }
}

void WorldClearance::add_pairs(const VectorXd& q, NearDistances& near) {
  const std::size_t count = std::min(
      pair_contacts_.size(), view_.closest_self(q, view_.self_influence_m(), pair_contacts_));
  const auto link_of = [&](int shape) {
    return model_.shapes()[static_cast<std::size_t>(shape)].link;
  };
  for (std::size_t i = 0; i < count; ++i) {
    const scene::SelfContact& contact = pair_contacts_[i];
    dynamics::point_jacobian_transpose(model_, ws_, link_of(contact.sphere_a), contact.point_a,
                                       contact.direction, gradient_);
    if (contact.sphere_b >= 0) {  // not the base
      dynamics::point_jacobian_transpose(model_, ws_, link_of(contact.sphere_b), contact.point_b,
                                         contact.direction, second_);
      gradient_ -= second_;
    }
    near.add(points_per_shape * shapes_ + contact.pair, contact.distance, gradient_);
  }
}

}  // namespace hamelin::optimal

#include "hamelin/reactive/obstacles.hpp"

#include <algorithm>

namespace hamelin::reactive {

namespace {

constexpr double same_direction = 0.95, same_place_m = 0.04;

}  // namespace

Obstacles::Obstacles(const planning::Setup& setup, double radius)
    : radius_(radius), points_(max_points), row_(setup.dof()) {
  for (const auto& shape : setup.shapes()) shape_link_.push_back(shape.link);
  for (auto& point : points_) point.row = Eigen::VectorXd::Zero(setup.dof());
  chosen_.reserve(max_points);
  near_.reserve(setup.shapes().size() * 32 + 64);
  const int links =
      shape_link_.empty() ? 0 : *std::max_element(shape_link_.begin(), shape_link_.end()) + 1;
  last_of_link_.resize(static_cast<std::size_t>(links));
}

// Nearest first. The spheres of a link have many contacts with almost the same row. A contact is
// left out if it is close to a nearer one of its link and obstacle and has almost the same
// direction.
void Obstacles::select(const planning::Contacts& contacts) {
  near_.clear();
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const double distance = contacts[i].distance_m;
    clearance_ = std::min(clearance_, distance);
    if (distance <= radius_ && near_.size() < near_.capacity()) near_.push_back({distance, i});
  }
  std::sort(near_.begin(), near_.end(), [](const Near& a, const Near& b) {
    return a.distance != b.distance ? a.distance < b.distance : a.contact < b.contact;
  });
  std::fill(last_of_link_.begin(), last_of_link_.end(), -1);
  chosen_.clear();
  for (const auto& near : near_) {
    if (count_ + chosen_.size() == points_.size()) return;
    const hamelin_contact& contact = contacts[near.contact];
    const auto n = planning::vec3(contact.direction_world),
               p = planning::vec3(contact.arm_point_world_m);
    int& last = last_of_link_[static_cast<std::size_t>(
        shape_link_[static_cast<std::size_t>(contact.shape)])];
    bool redundant = false;
    for (int j = last; j >= 0 && !redundant; j = chosen_[static_cast<std::size_t>(j)].before) {
      const hamelin_contact& other = contacts[chosen_[static_cast<std::size_t>(j)].contact];
      redundant =
          other.obstacle == contact.obstacle &&
          n.dot(planning::vec3(other.direction_world)) > same_direction &&
          (p - planning::vec3(other.arm_point_world_m)).squaredNorm() < same_place_m * same_place_m;
    }
    if (redundant) continue;
    chosen_.push_back({near.contact, last});
    last = static_cast<int>(chosen_.size()) - 1;
  }
}

void Obstacles::add_self(const model::Model& model, const dynamics::Workspace& ws,
                         const hamelin_self_contact& contact) {
  clearance_ = std::min(clearance_, contact.distance_m);
  if (contact.distance_m > self_radius_m || count_ == points_.size()) return;
  NearPoint& point = points_[count_++];
  point.shape = contact.shape_a;
  point.link = shape_link_[static_cast<std::size_t>(contact.shape_a)];
  point.obstacle = NearPoint::self;
  point.distance = contact.distance_m;
  point.arm_point = planning::vec3(contact.point_a_world_m);
  point.direction = planning::vec3(contact.direction_world);
  point.obstacle_speed = 0.0;
  dynamics::point_jacobian_transpose(model, ws, point.link, point.arm_point, point.direction,
                                     point.row);
  if (contact.shape_b == HAMELIN_SHAPE_OF_BASE) return;
  dynamics::point_jacobian_transpose(
      model, ws, shape_link_[static_cast<std::size_t>(contact.shape_b)],
      planning::vec3(contact.point_b_world_m), point.direction, row_);
  point.row -= row_;
}

void Obstacles::update(const model::Model& model, const dynamics::Workspace& ws,
                       const planning::Contacts& contacts,
                       const planning::SelfContacts& self_contacts) {
  clearance_ = radius_;
  count_ = 0;
  for (const auto& contact : self_contacts) add_self(model, ws, contact);
  select(contacts);
  for (const auto& chosen : chosen_) {
    const auto& contact = contacts[chosen.contact];
    NearPoint& point = points_[count_++];
    point.shape = contact.shape;
    point.link = shape_link_[static_cast<std::size_t>(contact.shape)];
    point.obstacle = contact.obstacle;
    point.distance = contact.distance_m;
    point.arm_point = planning::vec3(contact.arm_point_world_m);
    point.direction = planning::vec3(contact.direction_world);
    point.obstacle_speed = point.direction.dot(planning::vec3(contact.obstacle_velocity_world_m_s));
    dynamics::point_jacobian_transpose(model, ws, point.link, point.arm_point, point.direction,
                                       point.row);
  }
}

}  // namespace hamelin::reactive

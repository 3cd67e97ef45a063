#include "obstacles.hpp"

#include <algorithm>

namespace hamelin::hybrid {

Obstacles::Obstacles(const planning::Setup& setup, double radius)
    : radius_(radius), points_(max_points), row_(setup.dof()) {
  for (const auto& sphere : setup.spheres()) sphere_link_.push_back(sphere.link);
  for (auto& point : points_) point.row = Eigen::VectorXd::Zero(setup.dof());
  chosen_.reserve(max_points + per_link * 8);
}

// Spheres come in order, so a link's contacts stand together. Keeps the nearest few of each link and obstacle.
void Obstacles::select(std::span<const hamelin_contact> contacts) {
  const auto nearer = [&](std::size_t a, std::size_t b) {
    return contacts[a].distance_m != contacts[b].distance_m ? contacts[a].distance_m < contacts[b].distance_m : a < b;
  };
  const auto link_of = [&](std::size_t i) { return sphere_link_[static_cast<std::size_t>(contacts[i].sphere)]; };
  chosen_.clear();
  std::size_t link_begin = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (i > 0 && link_of(i) != link_of(i - 1)) link_begin = chosen_.size();
    clearance_ = std::min(clearance_, contacts[i].distance_m);
    if (contacts[i].distance_m > radius_) continue;
    std::size_t same = 0, farthest = chosen_.size();
    for (std::size_t j = link_begin; j < chosen_.size(); ++j) {
      if (contacts[chosen_[j]].obstacle != contacts[i].obstacle) continue;
      ++same;
      if (farthest == chosen_.size() || nearer(chosen_[farthest], chosen_[j])) farthest = j;
    }
    if (same < per_link && chosen_.size() < chosen_.capacity())
      chosen_.push_back(i);
    else if (farthest < chosen_.size() && nearer(i, chosen_[farthest]))
      chosen_[farthest] = i;
  }
  if (chosen_.size() > max_points) {
    std::nth_element(chosen_.begin(), chosen_.begin() + max_points, chosen_.end(), nearer);
    chosen_.resize(max_points);
  }
  std::sort(chosen_.begin(), chosen_.end(), nearer);
}

void Obstacles::add_self(const model::Model& model, const dynamics::Workspace& ws,
                         const hamelin_self_contact& contact) {
  clearance_ = std::min(clearance_, contact.distance_m);
  if (contact.distance_m > self_radius_m || count_ == points_.size()) return;
  NearPoint& point = points_[count_++];
  point.sphere = contact.sphere_a;
  point.link = sphere_link_[static_cast<std::size_t>(contact.sphere_a)];
  point.obstacle = NearPoint::self;
  point.distance = contact.distance_m;
  point.arm_point = planning::vec3(contact.point_a_world_m);
  point.direction = planning::vec3(contact.direction_world);
  point.obstacle_speed = 0.0;
  dynamics::point_jacobian_transpose(model, ws, point.link, point.arm_point, point.direction, point.row);
  if (contact.sphere_b == HAMELIN_SPHERE_OF_BASE) return;
  dynamics::point_jacobian_transpose(model, ws, sphere_link_[static_cast<std::size_t>(contact.sphere_b)],
                                     planning::vec3(contact.point_b_world_m), point.direction, row_);
  point.row -= row_;
}

void Obstacles::update(const model::Model& model, const dynamics::Workspace& ws,
                       std::span<const hamelin_contact> contacts, std::span<const hamelin_self_contact> self_contacts) {
  clearance_ = radius_;
  count_ = 0;
  for (const auto& contact : self_contacts) add_self(model, ws, contact);
  select(contacts);
  chosen_.resize(std::min(chosen_.size(), points_.size() - count_));
  for (const std::size_t i : chosen_) {
    const auto& contact = contacts[i];
    NearPoint& point = points_[count_++];
    point.sphere = contact.sphere;
    point.link = sphere_link_[static_cast<std::size_t>(contact.sphere)];
    point.obstacle = contact.obstacle;
    point.distance = contact.distance_m;
    point.arm_point = planning::vec3(contact.arm_point_world_m);
    point.direction = planning::vec3(contact.direction_world);
    point.obstacle_speed = point.direction.dot(planning::vec3(contact.obstacle_velocity_world_m_s));
    dynamics::point_jacobian_transpose(model, ws, point.link, point.arm_point, point.direction, point.row);
  }
}

}  // namespace hamelin::hybrid

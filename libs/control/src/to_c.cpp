#include "to_c.hpp"

#include <algorithm>

namespace hamelin::control {

namespace {

void write(const Eigen::Vector3d& from, double (&to)[3]) {
  std::copy_n(from.data(), 3, to);
}

hamelin_obstacle_state to_c(const scene::Obstacle& obstacle, std::int32_t id, double time_s) {
  hamelin_obstacle_state out{};
  out.id = id;
  out.shape = obstacle.shape == scene::Shape::sphere ? HAMELIN_OBSTACLE_SPHERE
              : obstacle.shape == scene::Shape::box  ? HAMELIN_OBSTACLE_BOX
                                                     : HAMELIN_OBSTACLE_CYLINDER;
  out.name = obstacle.name.c_str();
  out.radius_m = obstacle.radius_m;
  out.length_m = obstacle.length_m;
  write(obstacle.size_m, out.size_m);
  write(scene::position_at(obstacle, time_s), out.position_world_m);
  write(scene::velocity_at(obstacle, time_s), out.velocity_world_m_s);
  const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(obstacle.pose.R());
  std::copy_n(wxyz.data(), 4, out.quaternion_wxyz);
  return out;
}

}  // namespace

hamelin_contact to_c(const scene::Contact& contact, std::int32_t obstacle_id) {
  hamelin_contact out{};
  out.shape = contact.sphere;
  out.obstacle = obstacle_id;
  out.distance_m = contact.distance;
  write(contact.arm_point, out.arm_point_world_m);
  write(contact.obstacle_point, out.obstacle_point_world_m);
  write(contact.direction, out.direction_world);
  write(contact.obstacle_velocity, out.obstacle_velocity_world_m_s);
  return out;
}

hamelin_self_contact to_c(const scene::SelfContact& contact) {
  hamelin_self_contact out{};
  out.shape_a = contact.sphere_a;
  out.shape_b = contact.sphere_b;
  out.distance_m = contact.distance;
  write(contact.point_a, out.point_a_world_m);
  write(contact.point_b, out.point_b_world_m);
  write(contact.direction, out.direction_world);
  return out;
}

std::size_t list_obstacles(const scene::Environment& environment, std::span<const std::int32_t> ids,
                           double time_s, const planning::ArrayOut<hamelin_obstacle_state>& out) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < environment.obstacles().size(); ++i) {
    const scene::Obstacle& obstacle = environment.obstacles()[i];
    if (!scene::exists(obstacle, time_s)) continue;
    const auto id = ids.empty() ? static_cast<std::int32_t>(i) : ids[i];
    if (count < out.size()) out.set(count, to_c(obstacle, id, time_s));
    ++count;
  }
  return count;
}

}  // namespace hamelin::control

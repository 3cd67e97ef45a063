#include "loop/to_c.hpp"

#include <algorithm>

namespace hamelin::control {

namespace {

void write(const Eigen::Vector3d& from, double (&to)[3]) {
  std::copy_n(from.data(), 3, to);
}

std::int32_t to_c(scene::Shape shape) {
  switch (shape) {
    case scene::Shape::sphere:
    case scene::Shape::frame:
      return HAMELIN_OBSTACLE_SPHERE;
    case scene::Shape::box:
      return HAMELIN_OBSTACLE_BOX;
    case scene::Shape::cylinder:
      return HAMELIN_OBSTACLE_CYLINDER;
    case scene::Shape::capsule:
      return HAMELIN_OBSTACLE_CAPSULE;
  }
  return HAMELIN_OBSTACLE_SPHERE;
}

std::int32_t to_c(scene::Prediction prediction) {
  switch (prediction) {
    case scene::Prediction::path:
      return HAMELIN_PREDICTION_PATH;
    case scene::Prediction::constant_acceleration:
      return HAMELIN_PREDICTION_ACCELERATION;
    case scene::Prediction::constant_velocity:
      return HAMELIN_PREDICTION_VELOCITY;
    case scene::Prediction::speed_bound:
      return HAMELIN_PREDICTION_SPEED_BOUND;
  }
  return HAMELIN_PREDICTION_SPEED_BOUND;
}

hamelin_obstacle_state to_c(const scene::Obstacle& obstacle, std::int32_t id, bool moves,
                            const scene::Placed& at) {
  hamelin_obstacle_state out{};
  out.id = id;
  out.shape = to_c(obstacle.shape);
  out.name = obstacle.name.c_str();
  out.radius_m = obstacle.radius_m;
  out.length_m = obstacle.length_m;
  write(obstacle.size_m, out.size_m);
  write(at.pose.p(), out.position_world_m);
  write(at.velocity, out.velocity_world_m_s);
  write(at.acceleration, out.acceleration_world_m_s2);
  write(at.angular_velocity, out.angular_velocity_world_rad_s);
  const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(at.pose.R());
  std::copy_n(wxyz.data(), 4, out.quaternion_wxyz);
  out.moves = moves ? 1 : 0;
  out.prediction = to_c(obstacle.prediction);
  if (obstacle.prediction == scene::Prediction::speed_bound)
    out.speed_max_m_s = obstacle.speed_max_m_s;
  out.nearer_m = at.nearer_m;
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
                           const scene::Moment& moment, scene::Among among,
                           const planning::ArrayOut<hamelin_obstacle_state>& out) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < environment.obstacles().size(); ++i) {
    const scene::Obstacle& obstacle = environment.obstacles()[i];
    if (!scene::exists(obstacle, moment.now_s) || obstacle.shape == scene::Shape::frame) continue;
    if (among != scene::Among::all && environment.moves(i) != (among == scene::Among::moving))
      continue;
    const auto id = ids.empty() ? static_cast<std::int32_t>(i) : ids[i];
    if (count < out.size())
      out.set(count, to_c(obstacle, id, environment.moves(i), scene::placed_at(obstacle, moment)));
    ++count;
  }
  return count;
}

}  // namespace hamelin::control

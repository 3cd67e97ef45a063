#include "read_scene.hpp"

namespace hamelin::scene {

namespace {

JointNumbers read_joint_numbers(const Reader& in, const char* key, JointNumbers fallback) {
  const Json* given = in.find(key);
  if (given == nullptr) return fallback;
  JointNumbers numbers;
  if (given->is_string()) numbers.from_robot = true;
  if (given->is_number()) numbers.values = {given->get<double>()};
  if (given->is_array()) numbers.values = given->get<std::vector<double>>();
  if (numbers.values == std::vector<double>{0.0}) numbers.values.clear();
  return numbers;
}

}  // namespace

Payload read_payload(const Reader& in) {
  Payload payload;
  payload.name = in.get("name", payload.name);
  payload.mass_kg = in.get("mass_kg", 0.0);
  payload.position_m = in.vector("position_m", Eigen::Vector3d::Zero());
  const auto i = in.get<std::vector<double>>("inertia_kg_m2", {0, 0, 0, 0, 0, 0});
  payload.inertia_kg_m2 << i[0], i[3], i[4], i[3], i[1], i[5], i[4], i[5], i[2];
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  in.each("spheres", [&](const Reader& sphere) {
    payload.spheres.push_back({sphere.vector("center_m", zero), sphere.get("radius_m", 0.0)});
  });
  in.each("capsules", [&](const Reader& capsule) {
    payload.capsules.push_back({capsule.vector("from_m", zero), capsule.vector("to_m", zero),
                                capsule.get("radius_m", 0.0)});
  });
  payload.shapes_known = in.get("shapes_known", true);
  check(payload, in.place());
  return payload;
}

ModelFlags read_model(const Reader& in) {
  ModelFlags model;
  model.joint_damping = read_joint_numbers(in, "joint_damping", model.joint_damping);
  model.friction = read_joint_numbers(in, "friction", model.friction);
  model.friction_speed = in.get("friction_speed", model.friction_speed);
  model.armature = read_joint_numbers(in, "armature", model.armature);
  model.joint_limits = in.get("joint_limits", model.joint_limits);
  model.velocity_limits = in.get("velocity_limits", model.velocity_limits);
  model.torque_limits = in.get("torque_limits", model.torque_limits);
  model.self_collision = in.get("self_collision", model.self_collision);
  if (in.find("payload") != nullptr) model.payload = read_payload(in.child("payload"));
  return model;
}

}  // namespace hamelin::scene

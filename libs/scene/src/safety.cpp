#include "hamelin/scene/scene.hpp"

namespace hamelin::scene {

SafetyBounds safety_bounds(const Scene& scene) {
  const Safety& stated = scene.safety;
  const bool ideal = scene.actuation.type == ActuationType::ideal;
  return {stated.margin_m,
          stated.torque_share.value_or(ideal ? 0.95 : 0.8),
          stated.tracking_rad.value_or(ideal ? 1e-5 : 2e-4),
          stated.mass_error,
          stated.friction_share,
          stated.joint_noise_rad.value_or(scene.actuation.joint_noise_rad)};
}

SafetyType safety_type(const Scene& scene) {
  if (scene.safety.type) return *scene.safety.type;
  const ModelFlags& model = scene.model;
  const bool hazards = scene.map || !scene.obstacles.empty() || model.self_collision ||
                       model.joint_limits || model.velocity_limits;
  return hazards ? SafetyType::shield : SafetyType::none;
}

}  // namespace hamelin::scene

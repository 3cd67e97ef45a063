#include <cmath>

#include "hamelin/scene/scene.hpp"

namespace hamelin::scene {

SafetyBounds safety_bounds(const Scene& scene) {
  const auto stated_or = [](double stated, double otherwise) {
    return std::isnan(stated) ? otherwise : stated;
  };
  const Safety& safety = scene.safety;
  const bool ideal = scene.actuation.type == ActuationType::ideal;
  return {safety.margin_m,
          stated_or(safety.torque_share, ideal ? 0.95 : 0.8),
          stated_or(safety.tracking_rad, ideal ? 1e-5 : 2e-4),
          safety.mass_error,
          safety.friction_share,
          stated_or(safety.joint_noise_rad, scene.actuation.joint_noise_rad)};
}

SafetyType safety_type(const Scene& scene) {
  if (scene.safety.type) return *scene.safety.type;
  const ModelFlags& model = scene.model;
  const bool hazards = scene.map || !scene.obstacles.empty() || model.self_collision ||
                       model.joint_limits || model.velocity_limits;
  return hazards ? SafetyType::shield : SafetyType::none;
}

}  // namespace hamelin::scene

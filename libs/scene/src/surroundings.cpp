#include <fmt/format.h>

#include "hamelin/core/error.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::scene {

namespace {

// Owns the shapes of the robot in the scene's start configuration.
class RobotShapesAtStart {
 public:
  RobotShapesAtStart(const Scene& scene, const model::Model& model);
  [[nodiscard]] RobotAtStart view() const { return {arm_.view(), base_.view()}; }

 private:
  PlacedShapes arm_;
  BaseShapes base_;
};

RobotShapesAtStart::RobotShapesAtStart(const Scene& scene, const model::Model& model)
    : arm_(model), base_(model) {
  const Eigen::VectorXd q =
      scene.start_q.size() > 0 ? scene.start_q : Eigen::VectorXd::Zero(model.dof());
  if (q.size() != model.dof())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: /start/q: {} values given, expected {} (one per joint)",
                            scene.name, q.size(), model.dof()));
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, q);
  arm_.place(model, ws);
}

}  // namespace

BaseShapes::BaseShapes(const model::Model& model) {
  const auto add = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to, double radius) {
    centers_.push_back(model.base() * Eigen::Vector3d(0.5 * (from + to)));
    half_axes_.push_back(model.base().R() * (0.5 * (to - from)));
    radii_.push_back(radius);
  };
  for (const auto& sphere : model.robot().base_spheres)
    add(sphere.center_m, sphere.center_m, sphere.radius_m);
  for (const auto& capsule : model.robot().base_segments)
    add(capsule.from_m, capsule.to_m, capsule.radius_m);
}

MapRegion make_region(const Scene& scene, const model::Model& model, double influence) {
  if (!scene.map)
    throw Error(ErrorCode::usage, fmt::format("{}: /map: is missing, expected a map", scene.name));
  const RobotShapesAtStart robot(scene, model);
  return read_region(*scene.map, scene.base, model.reach(), influence, robot.view());
}

Environment make_environment(const Scene& scene, const model::Model& model, double influence) {
  const RobotShapesAtStart robot(scene, model);
  return {scene.map, scene.obstacles, scene.base, model.reach(), influence, robot.view()};
}

}  // namespace hamelin::scene

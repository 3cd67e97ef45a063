#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <memory>

#include "hamelin/mujoco/plant.hpp"
#include "hamelin/test/robots.hpp"
#include "hamelin/test/scene_data.hpp"

namespace hamelin::test {

/// A plant with its scene and its arm, which it keeps by reference.
struct Rig {
  explicit Rig(model::Model arm, scene::Scene in = {})
      : scene(std::move(in)), model(std::move(arm)) {
    damping = friction = Eigen::VectorXd::Zero(model.dof());
  }
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;

  simulation::Plant& make() {
    plant = mujoco::make_plant({scene, model, damping, friction});
    return *plant;
  }
  simulation::Plant& start(const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
    make().start(q, v);
    return *plant;
  }
  simulation::Plant& rest_at(const Eigen::VectorXd& q) {
    return start(q, Eigen::VectorXd::Zero(model.dof()));
  }

  scene::Scene scene;
  model::Model model;
  Eigen::VectorXd damping, friction;
  std::unique_ptr<simulation::Plant> plant;
};

/// A base pose without any special direction.
inline geometry::SE3 tilted_base() {
  const Eigen::Matrix3d R =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(0.3, -0.5, 0.8).normalized()).toRotationMatrix();
  return {R, {0.2, -0.3, 0.5}};
}

}  // namespace hamelin::test

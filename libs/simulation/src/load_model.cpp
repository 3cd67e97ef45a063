#include <Eigen/Eigenvalues>

#include "hamelin/model/robot_io.hpp"
#include "hamelin/simulation/run.hpp"

namespace hamelin::simulation {

namespace {

// A body fixed to the tip becomes part of the link that carries it: masses add, COM and inertia follow (parallel axes).
void add_payload(model::Robot& robot, const scene::Payload& payload) {
  auto& link = robot.links[static_cast<std::size_t>(robot.tip.link)];
  const geometry::SE3 tip_in_com = link.com.inverse() * robot.tip.pose;
  const Eigen::Vector3d at = tip_in_com * payload.position_m;
  const double mass = link.mass_kg + payload.mass_kg;
  const Eigen::Vector3d com = payload.mass_kg / mass * at;  // of both, in the old COM frame
  const auto steiner = [](double m, const Eigen::Vector3d& r) -> Eigen::Matrix3d {
    return m * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
  };
  link.inertia_kg_m2 += steiner(link.mass_kg, com) + steiner(payload.mass_kg, at - com) +
                        tip_in_com.R() * payload.inertia_kg_m2 * tip_in_com.R().transpose();
  link.mass_kg = mass;
  link.com = link.com * geometry::SE3{Eigen::Matrix3d::Identity(), com};
  for (auto& sphere : link.spheres) sphere.center_m -= com;
  for (auto& segment : link.segments) {
    segment.from_m -= com;
    segment.to_m -= com;
  }
}

}  // namespace

model::Model load_model(const scene::Scene& scene) {
  model::Robot robot = model::read_robot(scene.robot.file, {scene.robot.tip, scene.robot.spheres});
  if (scene.model.payload) add_payload(robot, *scene.model.payload);
  return model::Model(std::move(robot), scene.base, scene.gravity_m_s2.value_or(Eigen::Vector3d::Zero()));
}

}  // namespace hamelin::simulation

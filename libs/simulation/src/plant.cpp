#include "plant.hpp"

#include <fmt/format.h>

#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/simulation/run.hpp"

namespace hamelin::simulation {

namespace {

// A body fixed to the tip becomes part of the link that carries it: masses add, COM and inertia
// follow by the parallel-axis theorem.
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

// One number per joint, from the scene; empty: none.
Eigen::VectorXd joint_numbers(const scene::Scene& scene, const scene::JointNumbers& given,
                              const char* key, const model::Robot& robot,
                              double model::Joint::*member) {
  const int n = robot.dof();
  if (given.from_robot) {
    Eigen::VectorXd values(n);
    for (int i = 0; i < n; ++i) values[i] = robot.links[static_cast<std::size_t>(i)].joint.*member;
    return values.isZero(0.0) ? Eigen::VectorXd() : values;
  }
  if (given.values.empty()) return {};
  if (given.values.size() == 1) return Eigen::VectorXd::Constant(n, given.values[0]);
  if (given.values.size() != static_cast<std::size_t>(n))
    throw Error(ErrorCode::invalid, fmt::format("{}: /model/{}: {} values given, expected 1 or {}",
                                                scene.name, key, given.values.size(), n));
  return Eigen::Map<const Eigen::VectorXd>(given.values.data(), n);
}

}  // namespace

model::Model load_model(const scene::Scene& scene) {
  model::Robot robot = description::read_robot(
      scene.robot.file, {scene.robot.tip, scene.robot.spheres, scene.robot.srdf});
  if (scene.model.payload) add_payload(robot, *scene.model.payload);
  if (!scene.model.armature.from_robot) {
    const Eigen::VectorXd armature =
        joint_numbers(scene, scene.model.armature, "armature", robot, &model::Joint::armature);
    for (int i = 0; i < robot.dof(); ++i)
      robot.links[static_cast<std::size_t>(i)].joint.armature =
          armature.size() > 0 ? armature[i] : 0.0;
  }
  return model::Model(std::move(robot), scene.base,
                      scene.gravity_m_s2.value_or(Eigen::Vector3d::Zero()));
}

Eigen::VectorXd plant_damping(const scene::Scene& scene, const model::Robot& robot) {
  return joint_numbers(scene, scene.model.joint_damping, "joint_damping", robot,
                       &model::Joint::damping);
}

Eigen::VectorXd plant_friction(const scene::Scene& scene, const model::Robot& robot) {
  return joint_numbers(scene, scene.model.friction, "friction", robot, &model::Joint::friction);
}

std::vector<log::Input> inputs_of(const scene::Scene& scene) {
  std::vector<log::Input> inputs;
  std::error_code ec;
  if (scene.name != scene.robot.file && std::filesystem::is_regular_file(scene.name, ec))
    inputs.push_back({"scene", scene.name});
  inputs.push_back({"robot", scene.robot.file});
  if (scene.robot.spheres) inputs.push_back({"spheres", *scene.robot.spheres});
  if (scene.robot.srdf) inputs.push_back({"srdf", *scene.robot.srdf});
  return inputs;
}

Json resolved_config(const scene::Scene& scene) {
  Json config = scene::resolved_json(scene);
  Json& params = config["integrator"]["params"];
  params = with_defaults(params, Json::parse(schema_text("integrator")));
  return config;
}

}  // namespace hamelin::simulation

#include "plants.hpp"

#include <fmt/format.h>

#include "hamelin/core/error.hpp"
#include "hamelin/simulation/integrator_options.hpp"
#include "scene_values.hpp"

namespace hamelin::simulation {

using Eigen::VectorXd;

namespace {

void start(const scene::Scene& scene, const model::Model& model, Plant& plant) {
  const VectorXd zero = VectorXd::Zero(model.dof());
  plant.start(scene.start_q.size() > 0 ? scene.start_q : zero,
              scene.start_v.size() > 0 ? scene.start_v : zero);
}

}  // namespace

std::unique_ptr<SimulatedArm> make_simulated_arm(const scene::Scene& scene,
                                                 const model::Model& model) {
  auto arm = std::make_unique<SimulatedArm>(
      scene, model,
      integrator_options(scene.integrator.params, scene.name + ": /integrator/params"));
  start(scene, model, *arm);
  return arm;
}

std::unique_ptr<Plant> make_plant(const scene::Scene& scene, const model::Model& model,
                                  const PlantFactory& factory) {
  if (scene.plant == scene::PlantType::hamelin) return make_simulated_arm(scene, model);
  if (!factory)
    throw Error(ErrorCode::usage,
                fmt::format("{}: /plant/type: is {}, which this build of hamelin is without, "
                            "expected hamelin; to build with MuJoCo, install libmujoco-dev and "
                            "configure again",
                            scene.name, to_string(scene.plant)));
  VectorXd damping = plant_damping(scene, model.robot()),
           friction = plant_friction(scene, model.robot());
  if (damping.size() == 0) damping = VectorXd::Zero(model.dof());
  if (friction.size() == 0) friction = VectorXd::Zero(model.dof());
  std::unique_ptr<Plant> plant = factory({scene, model, damping, friction});
  start(scene, model, *plant);
  return plant;
}

}  // namespace hamelin::simulation

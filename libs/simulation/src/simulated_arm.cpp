#include "simulated_arm.hpp"

#include "hamelin/control/planner_setup.hpp"
#include "plant.hpp"

namespace hamelin::simulation {

using Eigen::VectorXd;

SimulatedArm::SimulatedArm(const scene::Scene& scene, const model::Model& arm,
                           const integration::Parameters& options)
    : model(arm),
      ws(arm),
      integrator(integration::make_integrator(scene.integrator.name, arm, options)),
      own_damping(plant_damping(scene, arm.robot())) {
  const VectorXd zero = VectorXd::Zero(arm.dof());
  v = zero;
  channels.coulomb = plant_friction(scene, arm.robot());
  channels.coulomb_speed = scene.model.friction_speed;
  if (scene.actuation.coulomb_friction_share > 0.0) {
    if (channels.coulomb.size() == 0) channels.coulomb = zero;
    channels.coulomb += scene.actuation.coulomb_friction_share *
                        control::joint_limits(arm.robot(), &model::Joint::effort_max, 0.0);
  }
  channels.held_torque = zero;
  channels.damping = own_damping.size() > 0 ? own_damping : zero;
  state = integrator->start(scene.start_q.size() > 0 ? scene.start_q : zero,
                            scene.start_v.size() > 0 ? scene.start_v : zero);
}

bool SimulatedArm::step(double step_s) {
  report = integrator->step(state, channels, step_s);
  if (report.converged) state.time_s = static_cast<double>(state.k) * step_s;
  return report.converged;
}

}  // namespace hamelin::simulation

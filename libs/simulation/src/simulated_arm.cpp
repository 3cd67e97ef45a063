#include "simulated_arm.hpp"

#include "hamelin/core/error.hpp"
#include "scene_values.hpp"

namespace hamelin::simulation {

using Eigen::VectorXd;

SimulatedArm::SimulatedArm(const scene::Scene& scene, const model::Model& arm,
                           const integration::Parameters& options)
    : model(arm),
      ws(arm),
      integrator(integration::make_integrator(scene.integrator.name, arm, options)),
      own_damping(plant_damping(scene, arm.robot())),
      scheme_(scene.integrator.name),
      options_(options),
      description_{"hamelin",
                   "hamelin",
                   std::string(version()),
                   integrator->name(),
                   integrator->criterion(),
                   integrator->tolerance(),
                   "found no root",
                   false} {
  const VectorXd zero = VectorXd::Zero(arm.dof());
  channels.coulomb = plant_friction(scene, arm.robot());
  channels.coulomb_speed = scene.model.friction_speed;
  channels.held_torque = zero;
  channels.damping = own_damping.size() > 0 ? own_damping : zero;
}

void SimulatedArm::start(const VectorXd& q, const VectorXd& v) {
  state = integrator->start(q, v);
  node_ = {0, 0.0, q, v};
  update_velocity();
}

// Schemes of more than one step begin again, as they do at the start of a run.
void SimulatedArm::take_load() {
  ws = dynamics::Workspace(model);
  integrator = integration::make_integrator(scheme_, model, options_);
  const VectorXd v = node_.v;
  state = integrator->start(node_.q, v);
  state.k = node_.k;
  state.time_s = node_.time_s;
  update_velocity();
}

bool SimulatedArm::step(const VectorXd& torque, double step_s) {
  channels.held_torque = torque;
  if (!step_channels(step_s)) return false;
  update_velocity();
  return true;
}

bool SimulatedArm::step_channels(double step_s) {
  report_ = integrator->step(state, channels, step_s);
  if (report_.converged) reach(step_s);
  return report_.converged;
}

void SimulatedArm::accept(const integration::State& stepped, const integration::StepReport& report,
                          double step_s) {
  state = stepped;
  report_ = report;
  reach(step_s);
}

void SimulatedArm::reach(double step_s) {
  state.time_s = static_cast<double>(state.k) * step_s;
  node_.k = state.k;
  node_.time_s = state.time_s;
  node_.q = state.q;
}

}  // namespace hamelin::simulation

#include "simulated_arm.hpp"

#include "hamelin/core/error.hpp"
#include "scene_values.hpp"

namespace hamelin::simulation {

using Eigen::VectorXd;

namespace {

integration::Channels own_channels(const scene::Scene& scene, const model::Robot& robot) {
  integration::Channels own;
  own.damping = plant_damping(scene, robot);
  own.coulomb = plant_friction(scene, robot);
  own.coulomb_speed = scene.model.friction_speed;
  return own;
}

}  // namespace

SimulatedArm::SimulatedArm(const scene::Scene& scene, const model::Model& model,
                           const integration::Parameters& options)
    : scheme_(scene.integrator.name),
      options_(options),
      arm_(model, integration::make_integrator(scheme_, model, options),
           own_channels(scene, model.robot())),
      description_{"hamelin",
                   "hamelin",
                   std::string(version()),
                   arm_.integrator->name(),
                   arm_.integrator->criterion(),
                   arm_.integrator->tolerance(),
                   "found no root",
                   false} {}

void SimulatedArm::start(const VectorXd& q, const VectorXd& v) {
  arm_.start(q, v);
  node_ = {0, 0.0, q, arm_.v};
}

void SimulatedArm::take_load() {
  arm_.take_load(integration::make_integrator(scheme_, arm_.model, options_));
  update_velocity();
}

bool SimulatedArm::step(const VectorXd& torque, double step_s) {
  arm_.channels.held_torque = torque;
  return make_step(step_s);
}

bool SimulatedArm::make_step(double step_s) {
  const bool made = arm_.step(step_s);
  report_ = arm_.report();
  if (!made) return false;
  node_.k = arm_.state.k;
  node_.time_s = arm_.state.time_s;
  node_.q = arm_.state.q;
  node_.v = arm_.v;
  return true;
}

}  // namespace hamelin::simulation

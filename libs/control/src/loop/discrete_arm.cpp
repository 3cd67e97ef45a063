#include "loop/discrete_arm.hpp"

#include <utility>

namespace hamelin::control {

using Eigen::VectorXd;

DiscreteArm::DiscreteArm(const model::Model& arm, std::unique_ptr<integration::Integrator> scheme,
                         const integration::Channels& own)
    : model(arm), ws(arm), integrator(std::move(scheme)), own_damping(own.damping), channels(own) {
  v = next_v_ = closing_kick = channels.held_torque = departure.set_v = departure.v =
      VectorXd::Zero(arm.dof());
  if (own_damping.size() == 0) channels.damping = v;
}

void DiscreteArm::start(const VectorXd& q, const VectorXd& v0) {
  state = integrator->start(q, v0);
  integrator->velocity(state, v);
}

// Schemes of more than one step begin again, as they do at the start of a run.
void DiscreteArm::take_load(std::unique_ptr<integration::Integrator> fresh) {
  ws = dynamics::Workspace(model);
  integrator = std::move(fresh);
  const VectorXd v0 = v, q = state.q;
  const long k = state.k;
  const double time_s = state.time_s;
  start(q, v0);
  state.k = k;
  state.time_s = time_s;
}

void DiscreteArm::kick(const VectorXd& impulse) {
  integrator->kick(state, impulse);
  integrator->velocity(state, v);
}

bool DiscreteArm::try_step(double step_s) {
  next_ = state;
  report_ = integrator->step(next_, channels, step_s);
  if (!report_.converged) return false;
  next_.time_s = static_cast<double>(next_.k) * step_s;
  if (closes_with_kick) integrator->kick(next_, closing_kick);
  integrator->velocity(next_, next_v_);
  tried_ = true;
  return true;
}

bool DiscreteArm::step(double step_s) {
  if (!tried_ && !try_step(step_s)) return false;
  tried_ = false;
  std::swap(state, next_);
  v = next_v_;
  return true;
}

}  // namespace hamelin::control

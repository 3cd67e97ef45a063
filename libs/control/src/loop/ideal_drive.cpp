#include "loop/ideal_drive.hpp"

namespace hamelin::control {

using Eigen::VectorXd;

IdealDrive::IdealDrive(const scene::Scene& scene, DiscreteArm& arm, const DriveOptions& options)
    : arm_(arm),
      step_s_(options.period_s),
      gyroscopic_terms_max_(options.gyroscopic_terms_max),
      limits_(arm.model, modelled_limits(scene, arm.model.robot()).effort_max,
              scene.actuation.torque_rate_max_Nm_s) {
  zero_ = VectorXd::Zero(arm.model.dof());
  q_ = v_ = gradient_ = gradient_before_ = impulse_ = change_ = zero_;
  setpoint_.torque = setpoint_.q = setpoint_.v = zero_;
}

void IdealDrive::measure(const VectorXd& q, const VectorXd& v, bool seen) {
  measured_ = arm_.state;
  if (!seen) return;
  q_ = q;
  v_ = v;
}

void IdealDrive::start() {
  arm_.channels.gyroscopic.reserve(gyroscopic_terms_max_);
  setpoint_.q = q_;
  setpoint_.v = v_;
}

void IdealDrive::continue_from(const Drive& other) {
  q_ = other.q();
  v_ = other.v();
}

// The planner of the arm with the other load starts from rest, so no half-kick is due.
void IdealDrive::take_over() {
  forget();
  start();
}

bool IdealDrive::propose(const planning::CommandBuffers& answer) {
  gradient_ = answer.potential_gradient();
  correct_kick();
  arm_.departure.energy = arm_.integrator->energy(arm_.state, arm_.v);
  arm_.departure.potential = answer.raw().potential_J != 0.0 || !gradient_.isZero(0.0);
  set_channels(answer);
  kick();
  return true;
}

void IdealDrive::correct_kick() {
  if (!arm_.closes_with_kick) return;
  impulse_ = 0.5 * step_s_ * (gradient_before_ - gradient_);
  arm_.kick(impulse_);
}

void IdealDrive::set_channels(const planning::CommandBuffers& answer) {
  auto& channels = arm_.channels;
  channels.held_torque = answer.held_torque();
  channels.damping = answer.damping();
  copy_gyroscopic_terms(answer, channels.gyroscopic);
  setpoint_.saturated = limits_.limit(arm_.ws, arm_.state.q, arm_.v, channels);
  arm_.departure.set_v = arm_.v;
  if (answer.raw().has_node_velocity != 0) set_node_velocity(answer);
  if (arm_.own_damping.size() > 0) channels.damping += arm_.own_damping;
  arm_.departure.v = arm_.departure.set_v;
}

void IdealDrive::set_node_velocity(const planning::CommandBuffers& answer) {
  change_ = answer.node_velocity() - arm_.v;
  const double share = limits_.share_of_velocity_change(arm_.ws, arm_.state.q, change_, step_s_,
                                                        arm_.channels.held_torque);
  if (share < 1.0) {
    setpoint_.saturated = true;
    arm_.departure.set_v += share * change_;
  } else {
    arm_.departure.set_v = answer.node_velocity();
  }
  arm_.integrator->set_velocity(arm_.state, arm_.departure.set_v);
}

// Both half-kicks of the step are by the gradient here, until the one at the next node is known. A
// potential that has acted once may act again at any node.
void IdealDrive::kick() {
  gradient_before_ = gradient_;
  arm_.closing_kick = -0.5 * step_s_ * gradient_;
  if (arm_.departure.potential) arm_.integrator->kick(arm_.state, arm_.closing_kick);
  arm_.closes_with_kick = arm_.closes_with_kick || arm_.departure.potential;
  if (arm_.closes_with_kick) arm_.integrator->velocity(arm_.state, arm_.departure.v);
}

std::optional<Shield::Step> IdealDrive::step() {
  if (!arm_.try_step(step_s_)) return std::nullopt;
  return Shield::Step{node(), arm_.departure.v, {arm_.next_q(), arm_.next_v()}, zero_, zero_,
                      zero_};
}

StopFinder::Start IdealDrive::stop_start() {
  return {q_, v_, zero_, zero_, zero_};
}

// From the node as it was measured.
void IdealDrive::follow(Stop& stop) {
  arm_.forget_trial();
  arm_.state = measured_;
  arm_.integrator->velocity(arm_.state, arm_.v);
  auto& channels = arm_.channels;
  channels.gyroscopic.clear();
  if (arm_.own_damping.size() > 0)
    channels.damping = arm_.own_damping;
  else
    channels.damping.setZero();
  stop.torque(node(), zero_, zero_, channels.held_torque);
  gradient_before_.setZero();
  arm_.closes_with_kick = setpoint_.saturated = false;
  arm_.departure.set_v = arm_.departure.v = v_;
}

}  // namespace hamelin::control

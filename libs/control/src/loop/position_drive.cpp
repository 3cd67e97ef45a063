#include "loop/position_drive.hpp"

#include <algorithm>
#include <cmath>

#include "loop/append_line.hpp"

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// The largest speeds of a set point, of size zero where they are not bounded. What the shield keeps
// for itself is left free: it would refuse what needs it.
VectorXd set_point_speeds(const scene::Scene& scene, const model::Model& model,
                          const LimitReserve& reserve) {
  VectorXd out = modelled_limits(scene, model.robot()).velocity_max;
  if (reserve.velocity.size() == out.size()) out -= reserve.velocity;
  return out;
}

}  // namespace

PositionDrive::PositionDrive(const scene::Scene& scene, const model::Model& model,
                             const DriveOptions& options, const LimitReserve& reserve)
    : model_(model),
      options_(options),
      measures_velocity_(!scene.actuation.estimates_velocity),
      velocity_max_(set_point_speeds(scene, model, reserve)),
      limits_(model, modelled_limits(scene, model.robot()).effort_max,
              scene.actuation.torque_rate_max_Nm_s),
      sum_(model, options.gyroscopic_terms_max),
      ws_(model) {
  q_ = v_ = q_measured_ = v_measured_ = rate_ = command_rate_ = torque_ =
      VectorXd::Zero(model.dof());
  setpoint_.torque = setpoint_.q = setpoint_.v = q_;
}

void PositionDrive::measure(const VectorXd& q, const VectorXd& v, bool seen) {
  if (seen) q_measured_ = q;
  if (seen && measures_velocity_) v_measured_ = v;
  q_ = started_ ? setpoint_.q : q_measured_;
  v_ = started_ ? setpoint_.v : v_measured_;
}

void PositionDrive::start() {
  started_ = true;
  setpoint_.q = q_;
  setpoint_.v = v_;
  setpoint_.saturated = false;
  command_rate_.setZero();
  dynamics::gravity_torque(model_, ws_, q_, setpoint_.torque);
}

void PositionDrive::continue_from(const Drive& other) {
  const auto& before = static_cast<const PositionDrive&>(other);
  q_ = before.q_;
  v_ = before.v_;
  q_measured_ = before.q_measured_;
  v_measured_ = before.v_measured_;
  started_ = before.started_;
  command_rate_ = before.command_rate_;
  setpoint_ = before.setpoint_;
}

// Servos lag while the arm moves, so that a set point that went back to where the arm is would
// jump. An arm that rests may be held by brakes, and must not be pulled to its set point.
bool PositionDrive::moves_as_sent() const {
  const bool moves = !v_.isZero(0.0) || (v_measured_.cwiseAbs().array() >
                                         options_.period_s * options_.acceleration_max.array())
                                            .any();
  return moves && ((q_measured_ - q_).cwiseAbs().array() <= options_.tracking_max.array()).all();
}

void PositionDrive::resume() {
  if (moves_as_sent()) return;
  q_ = setpoint_.q = q_measured_;
  v_ = setpoint_.v = v_measured_;
}

void PositionDrive::describe_defect(LineBuffer& line) const {
  Index j = 0;
  const VectorXd& most = options_.tracking_max;
  const double excess = ((q_measured_ - q_).cwiseAbs() - most).maxCoeff(&j);
  if (excess <= 0.0) return;
  const auto& joint = model_.robot().links[static_cast<std::size_t>(j)].joint;
  append(line, "joint '{}' is {:.3g} {} from its set point, expected at most {:.3g} (tracking_max)",
         joint.name, excess + most[j], joint.type == model::JointType::prismatic ? "m" : "rad",
         most[j]);
}

bool PositionDrive::propose(const planning::CommandBuffers& answer) {
  sum_.sum(ws_, answer, q_, v_, q_, options_.period_s, 1.0, torque_);
  if (!can_be_sent(torque_)) return false;
  setpoint_.saturated = limits_.limit(torque_, setpoint_.torque, options_.period_s);
  if (answer.raw().has_node_velocity != 0)
    rate_ = (answer.node_velocity() - v_) / options_.period_s;
  else
    dynamics::forward_dynamics(model_, ws_, q_, v_, torque_, rate_);
  if (!can_be_sent(rate_)) return false;
  advance();
  return true;
}

// The largest rate from which a jerk within its bound can end before the speed has risen by more
// than `rise`: the rise by a rate that falls from r to zero is r²/(2 j) + r T/2.
double PositionDrive::rate_up_to(double rise, Index joint) const {
  const double T = options_.period_s, j = options_.jerk_max[joint];
  if (!(rise > 0.0)) return rise / T;
  return j * (std::sqrt(0.25 * T * T + 2.0 * rise / j) - 0.5 * T);
}

void PositionDrive::advance() {
  const double T = options_.period_s;
  for (Index i = 0; i < rate_.size(); ++i) {
    const double step = options_.jerk_max[i] * T, most = options_.acceleration_max[i];
    double bounded = std::clamp(rate_[i], -most, most);
    if (velocity_max_.size() > 0)
      bounded = std::clamp(bounded, -rate_up_to(velocity_max_[i] + v_[i], i),
                           rate_up_to(velocity_max_[i] - v_[i], i));
    command_rate_[i] = std::clamp(bounded, command_rate_[i] - step, command_rate_[i] + step);
  }
  setpoint_.v = v_ + T * command_rate_;
  setpoint_.q = q_ + T * setpoint_.v;
}

std::optional<Shield::Step> PositionDrive::step() {
  return Shield::Step{node(),        v_,      {setpoint_.q, setpoint_.v},
                      command_rate_, torque_, command_rate_};
}

StopFinder::Start PositionDrive::stop_start() {
  return {q_, v_, command_rate_, setpoint_.torque, command_rate_};
}

void PositionDrive::follow(Stop& stop) {
  stop.point(setpoint_.q, setpoint_.v);
  command_rate_ = (setpoint_.v - v_) / options_.period_s;
  dynamics::inverse_dynamics(model_, ws_, q_, v_, command_rate_, torque_);
  setpoint_.saturated = limits_.limit(torque_, setpoint_.torque, options_.period_s);
}

const Setpoint& PositionDrive::send() {
  setpoint_.torque = torque_;
  return setpoint_;
}

}  // namespace hamelin::control

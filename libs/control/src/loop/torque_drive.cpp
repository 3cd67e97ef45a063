#include "loop/torque_drive.hpp"

#include <utility>

namespace hamelin::control {

using Eigen::VectorXd;

namespace {

StateEstimator make_estimator(const scene::Scene& scene, const model::Model& model,
                              double period_s) {
  const auto& actuation = scene.actuation;
  if (!actuation.estimates_velocity) return {model.dof(), period_s};
  return {model.dof(), period_s, actuation.estimator_bandwidth, actuation.joint_noise_rad};
}

}  // namespace

TorqueDrive::TorqueDrive(const scene::Scene& scene, const model::Model& model,
                         const DriveOptions& options)
    : model_(model),
      period_s_(options.period_s),
      limits_(model, modelled_limits(scene, model.robot()).effort_max,
              scene.actuation.torque_rate_max_Nm_s),
      sum_(model, options.gyroscopic_terms_max),
      pipeline_(model, options.delay_periods, options.period_s),
      estimate_(make_estimator(scene, model, options.period_s)),
      measures_velocity_(!scene.actuation.estimates_velocity),
      ws_(model) {
  zero_ = VectorXd::Zero(model.dof());
  q_ = v_ = q_measured_ = proposed_ = rate_ = zero_;
  setpoint_.torque = setpoint_.q = setpoint_.v = zero_;
}

void TorqueDrive::measure(const VectorXd& q, const VectorXd& v, bool seen) {
  looked_ = false;
  const bool seen_before = std::exchange(seen_, seen);
  predict_rate();
  if (!seen) {
    if (!can_be_sent(rate_)) rate_.setZero();
    estimate_.predict(rate_);
  } else if (!started_) {
    estimate_.start(q, measures_velocity_ ? v : zero_);
  } else if (seen_before && can_be_sent(rate_) && (!measures_velocity_ || can_be_sent(v))) {
    estimate_.update(q, v, rate_);
  } else {  // the prediction is of no use
    if (!measures_velocity_ && can_be_sent(rate_)) estimate_.predict(rate_);
    estimate_.move_to(q, measures_velocity_ ? v : estimate_.v());
  }
  q_ = estimate_.q();
  v_ = estimate_.v();
  q_measured_ = seen ? q : q_;
}

void TorqueDrive::predict_rate() {
  dynamics::forward_dynamics(model_, ws_, q_, v_, pipeline_.acting(), rate_);
}

// Against gravity.
void TorqueDrive::start() {
  started_ = true;
  setpoint_.q = q_;
  setpoint_.v = v_;
  dynamics::gravity_torque(model_, ws_, q_, setpoint_.torque);
  setpoint_.saturated = false;
  pipeline_.start_from(setpoint_.torque);
}

void TorqueDrive::continue_from(const Drive& other) {
  const auto& before = static_cast<const TorqueDrive&>(other);
  q_ = before.q_;
  v_ = before.v_;
  q_measured_ = before.q_measured_;
  estimate_ = before.estimate_;
  started_ = before.started_;
  seen_ = before.seen_;
  setpoint_ = before.setpoint_;
  pipeline_.continue_from(before.pipeline_);
}

bool TorqueDrive::propose(const planning::CommandBuffers& answer) {
  sum_.sum(ws_, answer, q_, v_, q_, period_s_, 1.0, proposed_);
  if (!can_be_sent(proposed_)) return false;
  saturated_ = limits_.limit(proposed_, pipeline_.last(), period_s_);
  return true;
}

void TorqueDrive::look_ahead() {
  if (std::exchange(looked_, true)) return;
  pipeline_.predict(ws_, q_measured_, v_, estimate_.disturbance());
}

std::optional<Shield::Step> TorqueDrive::step() {
  look_ahead();
  pipeline_.advance(ws_, proposed_);
  return Shield::Step{pipeline_.now(),          pipeline_.v(), pipeline_.next(),
                      pipeline_.acceleration(), proposed_,     estimate_.disturbance()};
}

StopFinder::Start TorqueDrive::stop_start() {
  look_ahead();
  dynamics::forward_dynamics(model_, ws_, pipeline_.q(), pipeline_.v(), pipeline_.last(), rate_);
  rate_ += estimate_.disturbance();
  return {pipeline_.q(), pipeline_.v(), rate_, pipeline_.last(), estimate_.disturbance()};
}

void TorqueDrive::follow(Stop& stop) {
  look_ahead();
  stop.torque(pipeline_.now(), estimate_.disturbance(), pipeline_.last(), proposed_);
  if (!can_be_sent(proposed_)) proposed_ = pipeline_.last();
  saturated_ = limits_.limit(proposed_, pipeline_.last(), period_s_);
}

const Setpoint& TorqueDrive::send() {
  setpoint_.torque = proposed_;
  setpoint_.saturated = saturated_;
  pipeline_.send(proposed_);
  return setpoint_;
}

}  // namespace hamelin::control

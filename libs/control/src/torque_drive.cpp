#include "torque_drive.hpp"

#include <utility>

namespace hamelin::control {

using Eigen::VectorXd;

TorqueDrive::TorqueDrive(const scene::Scene& scene, const model::Model& model,
                         const DriveOptions& options)
    : model_(model),
      period_s_(options.period_s),
      limits_(model, modelled_limits(scene, model.robot()).effort_max,
              scene.actuation.torque_rate_max_Nm_s),
      sum_(model, options.gyroscopic_terms_max),
      pipeline_(model, options.delay_periods, options.period_s),
      ws_(model) {
  zero_ = VectorXd::Zero(model.dof());
  q_ = v_ = q_measured_ = proposed_ = rate_ = zero_;
  setpoint_.torque = setpoint_.q = setpoint_.v = zero_;
  if (scene.actuation.estimates_velocity)
    estimator_.emplace(model.dof(), period_s_, scene.actuation.estimator_bandwidth,
                       scene.actuation.joint_noise_rad);
}

void TorqueDrive::measure(const VectorXd& q, const VectorXd& v, bool seen) {
  looked_before_ = std::exchange(looked_, false);
  const bool seen_before = std::exchange(seen_, seen);
  if (!seen) return extrapolate();
  q_measured_ = q;
  if (!estimator_) {
    q_ = q;
    v_ = v;
    return;
  }
  if (!started_) {
    estimator_->start(q, zero_);
  } else if (!seen_before) {
    extrapolate();  // v_ is that of the tick before
    q_measured_ = q;
    estimator_->start(q, v_);
  } else {
    dynamics::forward_dynamics(model_, ws_, q_, v_, pipeline_.acting(), rate_);
    estimator_->update(q, rate_);
  }
  q_ = estimator_->q();
  v_ = estimator_->v();
}

void TorqueDrive::extrapolate() {
  dynamics::forward_dynamics(model_, ws_, q_, v_, pipeline_.acting(), rate_);
  rate_ += estimator_ ? estimator_->disturbance() : pipeline_.disturbance();
  if (!can_be_sent(rate_)) rate_.setZero();  // the prediction diverges
  q_ += period_s_ * v_ + (0.5 * period_s_ * period_s_) * rate_;
  v_ += period_s_ * rate_;
  q_measured_ = q_;
}

// Against gravity.
void TorqueDrive::start() {
  started_ = true;
  setpoint_.q = q_;
  setpoint_.v = v_;
  dynamics::gravity_torque(model_, ws_, q_, setpoint_.torque);
  setpoint_.saturated = false;
  limits_.start_from(setpoint_.torque);
  pipeline_.start_from(setpoint_.torque);
}

void TorqueDrive::continue_from(const Drive& other) {
  const auto& before = static_cast<const TorqueDrive&>(other);
  q_ = before.q_;
  v_ = before.v_;
  q_measured_ = before.q_measured_;
  estimator_ = before.estimator_;
  started_ = before.started_;
  seen_ = before.seen_;
  setpoint_ = before.setpoint_;
  limits_.start_from(setpoint_.torque);
  pipeline_.continue_from(before.pipeline_);
}

bool TorqueDrive::propose(const planning::CommandBuffers& answer) {
  sum_.sum(ws_, answer, q_, v_, q_, period_s_, 1.0, proposed_);
  if (!can_be_sent(proposed_)) return false;
  saturated_ = limits_.limit(proposed_, period_s_);
  return true;
}

void TorqueDrive::look_ahead() {
  if (std::exchange(looked_, true)) return;
  if (!looked_before_) pipeline_.begin_observing();
  pipeline_.observe(ws_, q_, v_);
  pipeline_.predict(ws_, q_measured_, v_);
}

std::optional<Shield::Step> TorqueDrive::step() {
  look_ahead();
  pipeline_.advance(ws_, proposed_);
  return Shield::Step{pipeline_.now(),          pipeline_.v(), pipeline_.next(),
                      pipeline_.acceleration(), proposed_,     pipeline_.disturbance()};
}

StopFinder::Start TorqueDrive::stop_start() {
  look_ahead();
  dynamics::forward_dynamics(model_, ws_, pipeline_.q(), pipeline_.v(), pipeline_.last(), rate_);
  rate_ += pipeline_.disturbance();
  return {pipeline_.q(), pipeline_.v(), rate_, pipeline_.last(), pipeline_.disturbance()};
}

void TorqueDrive::follow(Stop& stop) {
  look_ahead();
  stop.torque(pipeline_.now(), pipeline_.disturbance(), pipeline_.last(), proposed_);
  if (!can_be_sent(proposed_)) proposed_ = pipeline_.last();
  limits_.start_from(pipeline_.last());
  saturated_ = limits_.limit(proposed_, period_s_);
}

const Setpoint& TorqueDrive::send() {
  setpoint_.torque = proposed_;
  setpoint_.saturated = saturated_;
  pipeline_.send(proposed_);
  return setpoint_;
}

}  // namespace hamelin::control

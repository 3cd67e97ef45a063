#include "arms.hpp"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::test {

using Eigen::VectorXd;

TorqueArm::TorqueArm(model::Model model, const VectorXd& q, double period_s,
                     std::size_t delay_periods)
    : model_(std::make_unique<model::Model>(std::move(model))),
      waiting_(delay_periods),
      period_s_(period_s) {
  integrator_ = integration::make_integrator("hamel-variational", *model_);
  put(q);
}

void TorqueArm::start() {
  state_ = integrator_->start(q_, v_);
}

// Whoever moves it lets it go when it is held against gravity.
void TorqueArm::put(const VectorXd& q) {
  q_ = q;
  v_ = VectorXd::Zero(q.size());
  dynamics::Workspace ws(*model_);
  VectorXd gravity(q.size());
  dynamics::gravity_torque(*model_, ws, q_, gravity);
  for (VectorXd& torque : waiting_) torque = gravity;
  start();
}

void TorqueArm::carry(const model::Model& model) {
  auto fresh = std::make_unique<model::Model>(model);
  integrator_ = integration::make_integrator("hamel-variational", *fresh);
  model_ = std::move(fresh);
  start();
}

void TorqueArm::step(const control::Answer& answer) {
  waiting_.push_back(answer.torque);
  channels_.held_torque = waiting_.front();
  waiting_.pop_front();
  if (!integrator_->step(state_, channels_, period_s_).converged)
    throw std::runtime_error("the integrator did not converge");
  q_ = state_.q;
  integrator_->velocity(state_, v_);
}

ServoArm::ServoArm(const VectorXd& q, double period_s, double lag_s)
    : period_s_(period_s), share_(lag_s > 0.0 ? 1.0 - std::exp(-period_s / lag_s) : 1.0) {
  put(q);
}

void ServoArm::put(const VectorXd& q) {
  q_ = q;
  v_ = VectorXd::Zero(q.size());
}

void ServoArm::step(const control::Answer& answer) {
  if (share_ == 1.0) {
    q_ = answer.q_next;
    v_ = answer.v_next;
    return;
  }
  v_ = share_ / period_s_ * (answer.q_next - q_);
  q_ += period_s_ * v_;
}

}  // namespace hamelin::test

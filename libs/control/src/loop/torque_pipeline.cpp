#include "loop/torque_pipeline.hpp"

namespace hamelin::control {

using Eigen::VectorXd;

TorquePipeline::TorquePipeline(const model::Model& model, std::size_t delay_periods,
                               double period_s)
    : model_(model), period_s_(period_s), waiting_(delay_periods, VectorXd::Zero(model.dof())) {
  q_ = v_ = q_next_ = v_next_ = rate_ = last_ = acting_ = disturbance_ =
      VectorXd::Zero(model.dof());
}

// The acceleration changes so little in a period that its value at the start is taken for all of
// it.
void TorquePipeline::step(dynamics::Workspace& ws, const VectorXd& q, const VectorXd& v,
                          const VectorXd& torque) {
  dynamics::forward_dynamics(model_, ws, q, v, torque, rate_);
  rate_ += disturbance_;
  q_next_ = q + period_s_ * v + (0.5 * period_s_ * period_s_) * rate_;
  v_next_ = v + period_s_ * rate_;
}

void TorquePipeline::predict(dynamics::Workspace& ws, const VectorXd& q, const VectorXd& v,
                             const VectorXd& disturbance) {
  q_ = q;
  v_ = v;
  disturbance_ = disturbance;
  for (std::size_t i = 0; i < waiting_.size(); ++i) {
    step(ws, q_, v_, waiting_[(first_ + i) % waiting_.size()]);
    q_.swap(q_next_);
    v_.swap(v_next_);
  }
}

void TorquePipeline::advance(dynamics::Workspace& ws, const VectorXd& torque) {
  step(ws, q_, v_, torque);
}

void TorquePipeline::start_from(const VectorXd& torque) {
  for (auto& waiting : waiting_) waiting = torque;
  last_ = acting_ = torque;
}

void TorquePipeline::continue_from(const TorquePipeline& other) {
  for (std::size_t i = 0; i < waiting_.size(); ++i) waiting_[i] = other.waiting_[i];
  first_ = other.first_;
  last_ = other.last_;
  acting_ = other.acting_;
}

void TorquePipeline::send(const VectorXd& torque) {
  last_ = torque;
  acting_ = waiting_.empty() ? torque : waiting_[first_];
  if (waiting_.empty()) return;
  waiting_[first_] = torque;
  first_ = (first_ + 1) % waiting_.size();
}

}  // namespace hamelin::control

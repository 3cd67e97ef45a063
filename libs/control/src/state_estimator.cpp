#include "hamelin/control/state_estimator.hpp"

#include <cmath>

namespace hamelin::control {

StateEstimator::StateEstimator(Eigen::Index dof, double period_s, double bandwidth)
    : period_s_(period_s) {
  const double theta = std::exp(-bandwidth * period_s), rest = 1.0 - theta;
  position_gain_ = 1.0 - theta * theta * theta;
  velocity_gain_ = 1.5 * rest * rest * (1.0 + theta) / period_s;
  disturbance_gain_ = rest * rest * rest / (period_s * period_s);
  q_ = v_ = disturbance_ = error_ = Eigen::VectorXd::Zero(dof);
}

void StateEstimator::start(const Eigen::VectorXd& q) {
  q_ = q;
  v_.setZero();
  disturbance_.setZero();
}

void StateEstimator::update(const Eigen::VectorXd& q, const Eigen::VectorXd& acceleration) {
  const double T = period_s_;
  q_ += T * v_ + 0.5 * T * T * (acceleration + disturbance_);
  v_ += T * (acceleration + disturbance_);
  error_ = q - q_;
  q_ += position_gain_ * error_;
  v_ += velocity_gain_ * error_;
  disturbance_ += disturbance_gain_ * error_;
}

}  // namespace hamelin::control

#include "hamelin/dynamics/damped_inverse.hpp"

#include <algorithm>

namespace hamelin::dynamics {

void DampedInverse::factor(const Matrix6Xd& J, double damping) {
  G_.noalias() = J * J.transpose();
  G_.diagonal().array() += damping;
  factors_.compute(G_);
}

void DampedInverse::factor_relative(const Matrix6Xd& J, double damping, double least_trace) {
  G_.noalias() = J * J.transpose();
  trace_ = std::max(least_trace, G_.trace());
  damping_ = damping;
  G_.diagonal().array() += damping * trace_;
  factors_.compute(G_);
}

void DampedInverse::damp_relative(double damping) {
  G_.diagonal().array() -= (damping_ - damping) * trace_;
  damping_ = damping;
  factors_.compute(G_);
}

void DampedInverse::apply(const Matrix6Xd& J, const geometry::Vector6d& error,
                          Eigen::VectorXd& out) const {
  const geometry::Vector6d y = factors_.solve(error);
  out.noalias() = J.transpose() * y;
}

}  // namespace hamelin::dynamics

// Uses dynamics from an install that needs only Eigen.
#include <hamelin/dynamics/dynamics.hpp>
#include <hamelin/model/make_chain.hpp>
#include <iostream>

int main() {
  const hamelin::model::Model arm(hamelin::model::make_chain({}));
  hamelin::dynamics::Workspace ws(arm);
  const Eigen::VectorXd q = Eigen::VectorXd::Constant(arm.dof(), 0.3),
                        rest = Eigen::VectorXd::Zero(arm.dof());
  Eigen::VectorXd tau(arm.dof()), a(arm.dof());
  hamelin::dynamics::gravity_torque(arm, ws, q, tau);
  hamelin::dynamics::forward_dynamics(arm, ws, q, rest, tau, a);
  std::cout << "largest acceleration under held gravity: " << a.lpNorm<Eigen::Infinity>() << '\n';
  return a.lpNorm<Eigen::Infinity>() < 1e-9 ? 0 : 1;
}

// Uses the installed package: a model, its dynamics, and an installed planner.
#include <cmath>
#include <hamelin/core/error.hpp>
#include <hamelin/dynamics/dynamics.hpp>
#include <hamelin/planning/plugin_host.hpp>
#include <iostream>

int main() {
  hamelin::model::Robot robot;
  robot.name = "pendulum";
  hamelin::model::Link link;
  link.name = "rod";
  link.joint.name = "hinge";
  link.joint.screw << 1.0, 0.0, 0.0, 0.0, 0.0, 0.0;
  link.com = hamelin::geometry::SE3{Eigen::Matrix3d::Identity(), Eigen::Vector3d{0.0, 0.5, 0.0}};
  link.mass_kg = 2.0;
  link.inertia_kg_m2 = Eigen::Matrix3d::Identity();
  robot.links.push_back(link);
  robot.tip = {"tip", 0, link.com};

  const hamelin::model::Model model(robot);
  hamelin::dynamics::Workspace ws(model);
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(1);
  Eigen::VectorXd a(1);
  hamelin::dynamics::forward_dynamics(model, ws, rest, rest, rest, a);
  const double expected = -2.0 * 9.81 * 0.5 / (1.0 + 2.0 * 0.5 * 0.5);
  const auto plugin = hamelin::planning::find_plugin("template", {PLUGIN_DIR});
  std::cout << "hamelin " << hamelin::version() << ": a = " << a[0] << ", planner " << plugin.name()
            << '\n';
  return std::abs(a[0] - expected) < 1e-12 ? 0 : 1;
}

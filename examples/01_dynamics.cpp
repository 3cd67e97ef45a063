// The dynamics of an arm from its URDF: torques, accelerations, mass matrix, and where the tip is.
#include <fmt/core.h>

#include <hamelin/description/robot_io.hpp>
#include <hamelin/dynamics/centroidal.hpp>
#include <hamelin/dynamics/dynamics.hpp>
#include <hamelin/dynamics/frames.hpp>

int main() {
  using namespace hamelin;
  const model::Model arm(description::read_robot("data/robots/arm7.urdf"));
  dynamics::Workspace ws(arm);  // one per thread
  const Eigen::VectorXd q = Eigen::VectorXd::Constant(7, 0.3);
  const Eigen::VectorXd v = Eigen::VectorXd::Constant(7, -0.2), a = Eigen::VectorXd::Ones(7);

  Eigen::VectorXd tau(7), back(7);
  dynamics::inverse_dynamics(arm, ws, q, v, a, tau);     // RNEA
  dynamics::forward_dynamics(arm, ws, q, v, tau, back);  // ABA
  fmt::print("{}: {} joints, {:.3f} kg\n", arm.robot().name, arm.dof(), dynamics::total_mass(arm));
  fmt::print("torque of the first joint: {:.9f} Nm\n", tau[0]);
  fmt::print("back from torques to accelerations: {}\n",
             (back - a).norm() < 1e-9 ? "equal" : "wrong");

  Eigen::MatrixXd mass(7, 7);
  dynamics::mass_matrix(arm, ws, q, mass);  // CRBA
  fmt::print("kinetic energy: {:.9f} J\n", 0.5 * v.dot(mass * v));

  dynamics::forward_kinematics(arm, ws, q);
  const Eigen::Vector3d tip = dynamics::frame_pose(arm, ws, arm.frame("flange")).p();
  fmt::print("tip: {:.6f} {:.6f} {:.6f} m\n", tip.x(), tip.y(), tip.z());
}

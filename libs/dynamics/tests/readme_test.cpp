#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/dynamics/derivatives.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/dynamics_batch.hpp"
#include "hamelin/dynamics/wrenches.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/test/readme.hpp"

using namespace hamelin;

TEST_CASE("the README's example holds gravity and leaves C v", "[dynamics][unit]") {
  // clang-format off
  // [example]
const model::Model arm(model::make_chain({}));  // seven links of 0.2 m, gravity along -z
dynamics::Workspace ws(arm);
const Eigen::VectorXd q = Eigen::VectorXd::Constant(7, 0.3), v = Eigen::VectorXd::Constant(7, -0.2);
Eigen::VectorXd tau(7), a(7);
dynamics::gravity_torque(arm, ws, q, tau);
dynamics::forward_dynamics(arm, ws, q, v, tau, a);  // gravity is held, so M a = -C v
dynamics::forward_kinematics(arm, ws, q);
const int tip = arm.frame("link7");  // by its name; the tip of a chain has that of its last link
const Eigen::Vector3d at = dynamics::frame_pose(arm, ws, tip).p();
dynamics::Matrix6Xd J(6, 7);  // J v is the tip's twist, angular part first
dynamics::frame_jacobian(arm, ws, tip, dynamics::Reference::local_world_aligned, J);
dynamics::ExternalWrench push{.frame = tip};
push.wrench << 0.0, 0.0, 0.0, 0.0, 0.0, -5.0;
Eigen::VectorXd loaded(7);  // what the joints exert while the tip is pushed down by 5 N
dynamics::inverse_dynamics(arm, ws, q, v, a, {&push, 1}, loaded);
dynamics::DerivativesWorkspace derivatives(arm);
Eigen::MatrixXd by_q(7, 7), by_v(7, 7), by_tau(7, 7);  // row i: the acceleration of joint i
dynamics::forward_dynamics_derivatives(arm, derivatives, q, v, tau, a, by_q, by_v, by_tau);
dynamics::DynamicsBatch batch(arm);
const dynamics::StatesXd states = q.replicate(1, 100);  // one state per column
dynamics::StatesXd masses(49, 100);  // row i + 7 j: entry (i, j) of the mass matrix at each state
batch.mass_matrix(states, masses);
  // [example]
  // clang-format on
  Eigen::MatrixXd M(7, 7);
  Eigen::VectorXd bias(7);
  dynamics::mass_matrix(arm, ws, q, M);
  dynamics::bias_torque(arm, ws, q, v, bias);
  CHECK((M * a + bias - tau).norm() < 1e-12);
  for (int i = 0; i < 7; ++i)
    for (int j = 0; j < 7; ++j) CHECK(std::abs(masses(i + 7 * j, 42) - M(i, j)) < 1e-14);
  CHECK((M * by_tau - Eigen::MatrixXd::Identity(7, 7)).norm() < 1e-10);
  CHECK(bias.norm() > 1.0);
  const double e = 1e-6;
  dynamics::forward_kinematics(arm, ws, q + e * v);
  CHECK((loaded - tau - J.bottomRows<3>().transpose() * Eigen::Vector3d(0, 0, 5)).norm() < 1e-12);
  CHECK((at - dynamics::tip_pose(arm, ws).p()).norm() < 1e-5);
  const Eigen::Vector3d ahead = dynamics::tip_pose(arm, ws).p();
  dynamics::forward_kinematics(arm, ws, q - e * v);
  CHECK(((ahead - dynamics::tip_pose(arm, ws).p()) / (2.0 * e) - J.bottomRows<3>() * v).norm() <
        1e-9);
  test::check_readme_example("libs/dynamics");
}

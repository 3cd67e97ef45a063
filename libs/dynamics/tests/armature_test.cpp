#include <Eigen/Cholesky>
#include <catch2/catch.hpp>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Rotors turn with their joints only, so M(q) becomes M(q) + diag(armature) and nothing else
// changes. The dense formula needs only the same robot without rotors.
TEST_CASE("rotor inertia adds a diagonal to the mass matrix in every algorithm",
          "[dynamics][armature]") {
  const bool planar = GENERATE(false, true);
  const int prismatic_every = GENERATE(0, 3);
  const auto seed = GENERATE(range(0u, 4u));
  CAPTURE(planar, prismatic_every, seed);
  const int n = 6;
  model::Robot robot = test::random_robot(seed, n, prismatic_every, planar);
  const model::Model bare(robot);
  Rng rng(1000 + seed);
  VectorXd armature(n);
  // from zero to far more than the inertia of the links
  for (int i = 0; i < n; ++i) armature[i] = i == 2 ? 0.0 : std::pow(10.0, rng.uniform(-3.0, 2.0));
  for (int i = 0; i < n; ++i) robot.links[static_cast<std::size_t>(i)].joint.armature = armature[i];
  const model::Model model(robot);
  REQUIRE(model.planar() == planar);
  dynamics::Workspace bare_ws(bare), ws(model);

  const VectorXd q = test::random_joints(rng, n, 3.0), v = test::random_joints(rng, n, 2.0);
  const VectorXd a = test::random_joints(rng, n, 5.0), tau = test::random_joints(rng, n, 10.0);
  MatrixXd M(n, n), dense(n, n);
  VectorXd bias(n), x(n);
  dynamics::mass_matrix(bare, bare_ws, q, dense);
  dense += armature.asDiagonal();
  dynamics::bias_torque(bare, bare_ws, q, v, bias);
  const Eigen::LLT<MatrixXd> factors(dense);
  const auto close = [](const VectorXd& ours, const VectorXd& theirs) {
    CHECK((ours - theirs).norm() <= 1e-11 * (1.0 + theirs.norm()));
  };

  dynamics::mass_matrix(model, ws, q, M);
  CHECK((M - dense).norm() <= 1e-13 * dense.norm());
  dynamics::bias_torque(model, ws, q, v, x);
  close(x, bias);
  dynamics::inverse_dynamics(model, ws, q, v, a, x);
  close(x, dense * a + bias);
  dynamics::forward_dynamics(model, ws, q, v, tau, x);
  close(x, factors.solve(tau - bias));
  dynamics::solve_mass(model, ws, q, tau, x);
  close(x, factors.solve(tau));
  dynamics::momentum(model, ws, q, v, x);
  close(x, dense * v);
  CHECK(dynamics::kinetic_energy(model, ws, q, v) == Approx(0.5 * v.dot(dense * v)).epsilon(1e-12));
  // chains without rotors use separate code
  CHECK(dynamics::potential_energy(model, ws, q) ==
        Approx(dynamics::potential_energy(bare, bare_ws, q)).epsilon(1e-13));
}

TEST_CASE("a massless link is accepted if its rotor has inertia", "[dynamics][armature]") {
  model::Robot robot = test::random_robot(7, 3);
  robot.links[2].mass_kg = 0.0;
  robot.links[2].inertia_kg_m2.setZero();
  CHECK_THROWS_WITH(model::Model(robot),
                    Catch::Contains("nothing it moves has inertia about joint 'joint2'"));
  robot.links[2].joint.armature = 0.05;
  const model::Model model(robot);
  dynamics::Workspace ws(model);
  VectorXd a(3);
  dynamics::forward_dynamics(model, ws, VectorXd::Constant(3, 0.3), VectorXd::Zero(3),
                             VectorXd::Unit(3, 2), a);
  CHECK(a.allFinite());
}

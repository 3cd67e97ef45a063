#include "hamelin/dynamics/derivatives.hpp"

#include <Eigen/Dense>
#include <catch2/catch.hpp>

#include "hamelin/core/error.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/exact_derivatives.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::dynamics;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;

namespace {

struct DerivativeCase {
  std::uint64_t seed;
  int n, prismatic_every;
  bool planar;
};

Model model_of(const DerivativeCase& c) {
  const auto base =
      geometry::SE3::exp((geometry::SE3::Tangent() << 0.3, -0.5, 0.8, 0.2, -0.1, 0.4).finished());
  model::Robot robot = test::random_robot(c.seed, c.n, c.prismatic_every, c.planar);
  for (std::size_t i = 0; i < robot.links.size(); i += 2) robot.links[i].joint.armature = 0.1;
  return Model(std::move(robot), base, Vector3d{1.0, -2.0, -9.0});
}

}  // namespace

TEST_CASE("derivatives of inverse and forward dynamics agree with complex steps",
          "[dynamics][derivatives]") {
  const auto c = GENERATE(DerivativeCase{1, 1, 0, false}, DerivativeCase{2, 3, 0, false},
                          DerivativeCase{3, 7, 0, false}, DerivativeCase{4, 6, 2, false},
                          DerivativeCase{5, 5, 1, false}, DerivativeCase{6, 4, 0, true},
                          DerivativeCase{7, 6, 3, true}, DerivativeCase{8, 2, 2, true},
                          DerivativeCase{9, 30, 4, false});
  CAPTURE(c.seed, c.n, c.prismatic_every, c.planar);
  const Model model = model_of(c);
  DerivativesWorkspace ws(model);
  Rng rng(c.seed + 100);
  const VectorXd q = test::random_joints(rng, c.n, 2.0), v = test::random_joints(rng, c.n, 2.0),
                 a = test::random_joints(rng, c.n, 3.0);
  MatrixXd dq(c.n, c.n), dv(c.n, c.n), da(c.n, c.n);
  inverse_dynamics_derivatives(model, ws, q, v, a, dq, dv, da);
  const MatrixXd expected = test::complex_steps(model, q, v, a);
  // a single joint has no Coriolis torque, only rounding
  const double scale = expected.rightCols(c.n).norm();
  const auto close = [&](const MatrixXd& x, const MatrixXd& y, double tolerance) {
    return (x - y).norm() <= tolerance * std::max(y.norm(), 1e-2 * scale);
  };
  CHECK(close(dq, expected.leftCols(c.n), 1e-12));
  CHECK(close(dv, expected.middleCols(c.n, c.n), 1e-12));
  CHECK(close(da, expected.rightCols(c.n), 1e-12));

  VectorXd tau(c.n), out(c.n);
  inverse_dynamics(model, ws.ws, q, v, a, tau);
  MatrixXd fq(c.n, c.n), fv(c.n, c.n), inverse(c.n, c.n);
  forward_dynamics_derivatives(model, ws, q, v, tau, out, fq, fv, inverse);
  const Eigen::LDLT<MatrixXd> M(expected.rightCols(c.n));
  const double condition = M.reconstructedMatrix().norm() * inverse.norm();
  CHECK((out - a).norm() <= 1e-14 * condition * a.norm());
  CHECK(close(fq, -M.solve(expected.leftCols(c.n)), 1e-15 * condition + 1e-12));
  CHECK(close(fv, -M.solve(expected.middleCols(c.n, c.n)), 1e-15 * condition + 1e-12));
  CHECK((inverse * expected.rightCols(c.n) - MatrixXd::Identity(c.n, c.n)).norm() <=
        1e-14 * condition);
}

TEST_CASE("second derivatives of the energies agree with nested dual numbers",
          "[dynamics][derivatives]") {
  const auto c = GENERATE(DerivativeCase{1, 1, 0, false}, DerivativeCase{3, 7, 0, false},
                          DerivativeCase{4, 6, 2, false}, DerivativeCase{5, 5, 1, false},
                          DerivativeCase{6, 4, 0, true}, DerivativeCase{7, 6, 3, true},
                          DerivativeCase{9, 12, 4, false});
  CAPTURE(c.seed, c.n, c.prismatic_every, c.planar);
  const Model model = model_of(c);
  Rng rng(c.seed + 200);
  const VectorXd q = test::random_joints(rng, c.n, 2.0), v = test::random_joints(rng, c.n, 2.0);
  KineticDerivatives kinetic(c.n);
  PotentialDerivatives potential(c.n);
  DerivativesWorkspace ws(model);
  energy_derivatives(model, ws, q, v, kinetic, potential);

  const test::ReferenceDynamics<test::HyperDual> reference(model);
  const auto close = [](const MatrixXd& x, const MatrixXd& y, double scale) {
    return (x - y).norm() <= 1e-12 * scale;
  };
  const Index n = c.n;
  VectorXd x(2 * n), gradient;
  x << q, v;
  MatrixXd H;
  test::hessian([&](const auto& at) { return reference.kinetic_energy(at.head(n), at.tail(n)); }, x,
                gradient, H);
  const double scale = H.norm();
  CHECK(close(kinetic.p, gradient.tail(n), scale));
  CHECK(close(kinetic.dK_dq, gradient.head(n), scale));
  CHECK(close(kinetic.M, H.bottomRightCorner(n, n), scale));
  CHECK(close(kinetic.dp_dq, H.bottomLeftCorner(n, n), scale));
  CHECK(close(kinetic.d2K_dq2, H.topLeftCorner(n, n), scale));
  test::hessian([&](const auto& at) { return reference.potential_energy(at); }, q, gradient, H);
  CHECK(close(potential.dU_dq, gradient, gradient.norm()));
  CHECK(close(potential.d2U_dq2, H, gradient.norm()));

  KineticDerivatives alone(c.n);
  PotentialDerivatives alone_too(c.n);
  kinetic_derivatives(model, ws, q, v, alone);
  potential_derivatives(model, ws, q, alone_too);
  CHECK(alone.d2K_dq2 == kinetic.d2K_dq2);
  CHECK(alone_too.d2U_dq2 == potential.d2U_dq2);
}

TEST_CASE("derivatives do not allocate, and refuse what does not fit", "[dynamics][derivatives]") {
  const Model model = model_of({3, 7, 3, false}), other = model_of({4, 6, 0, false});
  DerivativesWorkspace ws(model);
  const VectorXd x = VectorXd::LinSpaced(7, -1.0, 1.0);
  VectorXd a(7);
  MatrixXd dq(7, 7), dv(7, 7), dtau(7, 7), wide(7, 8);
  if (test::counts_allocations())
    CHECK(test::allocations_in(
              [&] { forward_dynamics_derivatives(model, ws, x, x, x, a, dq, dv, dtau); }) == 0);
  KineticDerivatives kinetic(7), small(6);
  PotentialDerivatives potential(7);
  if (test::counts_allocations())
    CHECK(test::allocations_in([&] { energy_derivatives(model, ws, x, x, kinetic, potential); }) ==
          0);
  CHECK_THROWS_AS(kinetic_derivatives(model, ws, x, x, small), Error);
  CHECK_THROWS_AS(kinetic_derivatives(model, ws, x, x.head(6), kinetic), Error);
  CHECK_THROWS_AS(potential_derivatives(model, ws, x.head(6), potential), Error);
  CHECK_THROWS_AS(inverse_dynamics_derivatives(other, ws, x, x, x, dq, dv, dtau), Error);
  CHECK_THROWS_AS(inverse_dynamics_derivatives(model, ws, x, x, x, dq, wide, dtau), Error);
  CHECK_THROWS_AS(inverse_dynamics_derivatives(model, ws, x, x.head(6), x, dq, dv, dtau), Error);
}

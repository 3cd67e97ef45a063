#include "hamelin/dynamics/regressor.hpp"

#include <catch2/catch.hpp>

#include "hamelin/test/allocations.hpp"
#include "hamelin/test/frames.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::dynamics;
using Eigen::MatrixXd;

TEST_CASE("inverse dynamics is the regressor times the parameters", "[dynamics][regressor]") {
  const auto c = GENERATE(test::FrameCase{1, 1, 0, false}, test::FrameCase{2, 7, 0, false},
                          test::FrameCase{3, 6, 2, false}, test::FrameCase{4, 5, 1, false},
                          test::FrameCase{5, 4, 0, true}, test::FrameCase{6, 6, 3, true});
  CAPTURE(c.seed);
  const Model model = test::model_with_frames(c.seed, c.n, c.prismatic_every, c.planar);
  Rng rng(c.seed + 70);
  const VectorXd q = test::random_joints(rng, c.n, 2.0), v = test::random_joints(rng, c.n, 2.0),
                 a = test::random_joints(rng, c.n, 3.0);
  Workspace ws(model);
  MatrixXd Y(c.n, 10 * c.n);
  inverse_dynamics_regressor(model, ws, q, v, a, Y);
  VectorXd tau(c.n), other(c.n);
  inverse_dynamics(model, ws, q, v, a, tau);
  const VectorXd parameters = inertial_parameters(model);
  CHECK((Y * parameters - tau).norm() <= 1e-12 * (1.0 + tau.norm()));

  // Other parameters give another robot, whose torques the same regressor predicts.
  VectorXd heavier = parameters;
  for (int i = 0; i < c.n; ++i) {
    heavier.segment<10>(10 * i) *= 1.0 + 0.1 * i;
    heavier[10 * i + 1] += 0.02;
    for (const int k : {4, 5, 6}) heavier[10 * i + k] += 0.5;
  }
  const Model changed(with_inertial_parameters(model, heavier), model.base(), model.gravity());
  Workspace changed_ws(changed);
  inverse_dynamics(changed, changed_ws, q, v, a, other);
  CHECK((Y * heavier - other).norm() <= 1e-11 * (1.0 + other.norm()));
  CHECK((other - tau).norm() > 1e-3 * tau.norm());

  const Model same(with_inertial_parameters(model, parameters), model.base(), model.gravity());
  CHECK((inertial_parameters(same) - parameters).norm() <= 1e-12 * parameters.norm());
}

TEST_CASE("the rate of the momentum is the torque and what no torque makes",
          "[dynamics][regressor]") {
  const auto c = GENERATE(test::FrameCase{1, 1, 0, false}, test::FrameCase{2, 7, 0, false},
                          test::FrameCase{3, 6, 2, false}, test::FrameCase{4, 5, 1, false},
                          test::FrameCase{5, 4, 0, true}, test::FrameCase{6, 6, 3, true});
  CAPTURE(c.seed);
  const Model model = test::model_with_frames(c.seed, c.n, c.prismatic_every, c.planar);
  Rng rng(c.seed + 71);
  const VectorXd q = test::random_joints(rng, c.n, 2.0), v = test::random_joints(rng, c.n, 2.0),
                 a = test::random_joints(rng, c.n, 3.0);
  Workspace ws(model);
  MatrixXd P(c.n, 10 * c.n), L(c.n, 10 * c.n), Y(c.n, 10 * c.n), before = P, after = P, other = L;
  inverse_dynamics_regressor(model, ws, q, v, a, Y);
  momentum_regressor(model, ws, q, v, P, L);
  const auto momentum_at = [&](double t, MatrixXd& out) {
    momentum_regressor(model, ws, q + t * v + 0.5 * t * t * a, v + t * a, out, other);
  };
  const double t = 1e-4;
  momentum_at(-t, before);
  momentum_at(t, after);
  CHECK(((after - before) / (2.0 * t) - L - Y).cwiseAbs().maxCoeff() <= 1e-5);
  VectorXd p(c.n);
  momentum(model, ws, q, v, p);
  CHECK((P * inertial_parameters(model) - p).norm() <= 1e-12 * (1.0 + p.norm()));
}

TEST_CASE("the regressor does not allocate, and refuses what does not fit",
          "[dynamics][regressor]") {
  const Model model = test::model_with_frames(2, 7, 3, false);
  Workspace ws(model);
  const VectorXd q = VectorXd::Constant(7, 0.3);
  MatrixXd Y(7, 70), wrong(7, 69);
  CHECK_THROWS_AS(inverse_dynamics_regressor(model, ws, q, q, q, wrong), Error);
  CHECK_THROWS_AS(with_inertial_parameters(model, q), Error);
  VectorXd negative = inertial_parameters(model);
  negative[0] = -1.0;
  CHECK_THROWS_AS(with_inertial_parameters(model, negative), Error);
  test::require_allocation_count();
  CHECK(test::allocations_in([&] { inverse_dynamics_regressor(model, ws, q, q, q, Y); }) == 0);
  MatrixXd P = Y, L = Y;
  CHECK_THROWS_AS(momentum_regressor(model, ws, q, q, wrong, L), Error);
  CHECK_THROWS_AS(momentum_regressor(model, ws, q, q, P, wrong), Error);
  CHECK(test::allocations_in([&] { momentum_regressor(model, ws, q, q, P, L); }) == 0);
}

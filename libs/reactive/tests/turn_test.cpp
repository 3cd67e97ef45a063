#include "hamelin/reactive/turn.hpp"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>

#include "hamelin/test/random_mass.hpp"

using namespace hamelin;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using reactive::Turn;
using reactive::Turner;

namespace {

constexpr int dof = 6;

/// The generator S of the turn in the plane of u and p: docs/theory.md (10.8).
MatrixXd generator(const MatrixXd& G, const VectorXd& u, const VectorXd& p) {
  const VectorXd u_hat = u / std::sqrt(u.dot(G * u));
  VectorXd p_hat = p - p.dot(G * u_hat) * u_hat;
  p_hat /= std::sqrt(p_hat.dot(G * p_hat));
  return p_hat * u_hat.transpose() * G - u_hat * p_hat.transpose() * G;
}

}  // namespace

TEST_CASE("a turn is the exponential of a map that is skew in the metric", "[reactive][turn]") {
  Rng rng(3);
  Turner turner(dof);
  for (int k = 0; k < 100; ++k) {
    const MatrixXd G = test::random_mass(rng, dof);
    const VectorXd u = test::random_numbers(rng, dof);
    const Turn turn{test::random_numbers(rng, dof), rng.uniform(-3.0, 3.0), 1.0};
    const MatrixXd S = generator(G, u, turn.direction);
    REQUIRE((G * S + (G * S).transpose()).norm() < 1e-10 * (G * S).norm());
    VectorXd turned = u;
    turner.rotate(turn, G, turned);
    const MatrixXd rotation = (turn.angle * S).exp();
    REQUIRE((turned - rotation * u).norm() < 1e-9 * u.norm() * (1.0 + rotation.norm()));
    REQUIRE(turned.dot(G * turned) == Approx(u.dot(G * u)).epsilon(1e-12));
  }
}

TEST_CASE("a turned velocity has the cruise speed at most", "[reactive][turn]") {
  Rng rng(4);
  Turner turner(dof);
  for (int k = 0; k < 100; ++k) {
    const MatrixXd G = test::random_mass(rng, dof);
    VectorXd u = test::random_numbers(rng, dof);
    const VectorXd before = 2.0 / u.lpNorm<Eigen::Infinity>() * u;
    const Turn turn{test::random_numbers(rng, dof), std::numbers::pi / 2, 1.0};
    turner.apply(turn, G, 2.0, u);
    REQUIRE(u.lpNorm<Eigen::Infinity>() <= 2.0 * (1.0 + 1e-12));
    REQUIRE(u.dot(G * u) <= before.dot(G * before) * (1.0 + 1e-9));
    REQUIRE(std::abs(u.dot(G * before)) < 1e-9 * G.norm() * 4.0);  // a right angle in the metric
  }
}

TEST_CASE("what has no plane is not turned", "[reactive][turn]") {
  const MatrixXd G = MatrixXd::Identity(3, 3);
  Turner turner(3);
  VectorXd rest = VectorXd::Zero(3), u = Eigen::Vector3d(0.5, 0.0, 0.0);
  turner.apply({Eigen::Vector3d(1.0, 0.0, 0.0), 1.0, 1.0}, G, 2.0, rest);
  CHECK(rest.norm() == 0.0);
  turner.rotate({Eigen::Vector3d(-2.0, 0.0, 0.0), 1.0, 1.0}, G, u);
  CHECK(u == Eigen::Vector3d(0.5, 0.0, 0.0));
}

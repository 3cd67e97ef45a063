#include "hamelin/identification/pseudo_inertia.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/core/rng.hpp"
#include "hamelin/identification/objective.hpp"

using namespace hamelin;
using namespace hamelin::identification;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Mass, first moment and inertia of point masses about the origin.
LinkParameters point_masses(Rng& rng, int count) {
  LinkParameters out = LinkParameters::Zero();
  for (int i = 0; i < count; ++i) {
    const double m = rng.uniform(0.2, 1.0);
    const Eigen::Vector3d p(rng.normal(), rng.normal(), rng.normal());
    const Eigen::Matrix3d inertia =
        m * (p.squaredNorm() * Eigen::Matrix3d::Identity() - p * p.transpose());
    LinkParameters one;
    one << m, m * p, inertia(0, 0), inertia(1, 1), inertia(2, 2), inertia(0, 1), inertia(0, 2),
        inertia(1, 2);
    out += one;
  }
  return out;
}

Objective random_objective(Rng& rng) {
  Objective objective;
  objective.links = 2;
  objective.prior_weight = 0.7;
  objective.friction_weight = 0.3;
  objective.friction_prior = VectorXd::Constant(3, 0.2);
  for (int j = 0; j < 2; ++j) {
    Objective::Equations equations{MatrixXd(30, objective.size()), VectorXd(30),
                                   rng.uniform(0.5, 2.0)};
    for (double& x : equations.R.reshaped()) x = rng.normal();
    for (double& y : equations.y) y = rng.normal();
    objective.joints.push_back(equations);
  }
  return objective;
}

VectorXd random_coordinates(Rng& rng, const Objective& objective, double scale) {
  VectorXd x(objective.size());
  for (double& value : x) value = scale * rng.normal();
  x.tail(3) = x.tail(3).cwiseAbs();
  return x;
}

}  // namespace

TEST_CASE("a pseudo-inertia is the second moment of the mass", "[identification][unit]") {
  Rng rng(1);
  for (int trial = 0; trial < 10; ++trial) {
    const LinkParameters parameters = point_masses(rng, 5);
    const Eigen::Matrix4d P = pseudo_inertia(parameters);
    CHECK(Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(P).eigenvalues()[0] > 0.0);
    CHECK((link_parameters(P) - parameters).norm() <= 1e-14 * parameters.norm());
  }
  // two point masses are a body without thickness
  const Eigen::Matrix4d line = pseudo_inertia(point_masses(rng, 2));
  CHECK(std::abs(line.determinant()) <= 1e-12);
}

TEST_CASE("coordinates of a link begin at the prior and keep bodies bodies",
          "[identification][unit]") {
  Rng rng(2);
  const LinkParameters prior = point_masses(rng, 6);
  const LinkCoordinates coordinates(prior);
  CHECK_FALSE(coordinates.repaired());
  CHECK(coordinates.prior() == prior);
  for (int trial = 0; trial < 20; ++trial) {
    LinkParameters z;
    for (double& value : z) value = 0.6 * rng.normal();
    const bool body =
        Eigen::LLT<Eigen::Matrix4d>(pseudo_inertia(prior + coordinates.to_parameters() * z))
            .info() == Eigen::Success;
    CHECK(std::isfinite(divergence(z).value) == body);
  }
  // all ten parameters times 1.1: P = 1.1 P₀, so Z = 0.1
  LinkParameters z = LinkParameters::Zero();
  z.head<4>().setConstant(0.1);
  CHECK((prior + coordinates.to_parameters() * z - 1.1 * prior).norm() <= 1e-13 * prior.norm());
  CHECK(divergence(z).value == Approx(4.0 * (0.1 - std::log(1.1))));
}

TEST_CASE("a prior that no body has is replaced by one with its mass and centre of mass",
          "[identification][unit]") {
  LinkParameters impossible;
  impossible << 2.0, 0.2, 0.0, 0.0, 1.0, 1.02, 3.02, 0.0, 0.0, 0.0;
  const LinkCoordinates coordinates(impossible);
  CHECK(coordinates.repaired());
  CHECK(coordinates.prior().head<4>() == impossible.head<4>());
  CHECK(Eigen::LLT<Eigen::Matrix4d>(pseudo_inertia(coordinates.prior())).info() == Eigen::Success);
}

TEST_CASE("gradient and Hessian of the objective equal differences", "[identification][unit]") {
  Rng rng(3);
  const Objective objective = random_objective(rng);
  const VectorXd x = random_coordinates(rng, objective, 0.15);
  VectorXd gradient, up, down;
  MatrixXd hessian;
  REQUIRE(std::isfinite(objective.evaluate(x, &gradient, &hessian)));
  const double h = 1e-5;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const VectorXd step = h * VectorXd::Unit(x.size(), i);
    const double difference =
        objective.evaluate(x + step, &up, nullptr) - objective.evaluate(x - step, &down, nullptr);
    CHECK(std::abs(difference / (2.0 * h) - gradient[i]) <= 1e-6 * gradient.norm());
    CHECK(((up - down) / (2.0 * h) - hessian.col(i)).norm() <= 1e-7 * hessian.norm());
  }
}

TEST_CASE("the minimum meets the conditions of Karush, Kuhn and Tucker", "[identification][unit]") {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Rng rng(seed);
    Objective objective = random_objective(rng);
    for (auto& joint : objective.joints) joint.y.array() -= 0.8 * joint.R.col(21).array();
    VectorXd start = VectorXd::Zero(objective.size());
    start.tail(3) = objective.friction_prior;
    const VectorXd x = minimum(objective, start);
    VectorXd gradient;
    const double value = objective.evaluate(x, &gradient, nullptr);
    CHECK(x[21] == 0.0);
    CHECK(gradient[21] > 0.0);
    CHECK((x.tail(3).array() >= 0.0).all());
    for (Eigen::Index i = 0; i < x.size(); ++i)
      if (i < 20 || x[i] > 0.0) CHECK(std::abs(gradient[i]) <= 1e-5);
    for (int trial = 0; trial < 20; ++trial)
      CHECK(objective.evaluate(random_coordinates(rng, objective, 0.2), nullptr, nullptr) >= value);
  }
}

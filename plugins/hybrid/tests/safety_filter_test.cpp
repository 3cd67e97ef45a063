#include "../src/safety_filter.hpp"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <limits>

#include "hamelin/core/rng.hpp"
#include "hamelin/test/allocations.hpp"

using Eigen::MatrixXd;
using Eigen::VectorXd;
using hamelin::Rng;
using hamelin::hybrid::SafetyFilter;

namespace {

VectorXd random_vector(Rng& rng, int n, double size = 1.0) {
  VectorXd x(n);
  for (int i = 0; i < n; ++i) x[i] = rng.uniform(-size, size);
  return x;
}

MatrixXd random_mass(Rng& rng, int n) {
  MatrixXd A(n, n);
  for (int j = 0; j < n; ++j) A.col(j) = random_vector(rng, n);
  return A * A.transpose() + 0.05 * MatrixXd::Identity(n, n);
}

// The nearest admissible point by trying every set of active rows: slow, and independent of the dual iteration.
VectorXd nearest_by_active_sets(const MatrixXd& M, const VectorXd& wanted, const MatrixXd& rows, const VectorXd& b) {
  const auto n = wanted.size(), m = rows.cols();
  VectorXd best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (unsigned set = 0; set < (1u << m); ++set) {
    MatrixXd active(n, 0);
    VectorXd rhs(0);
    for (Eigen::Index i = 0; i < m; ++i) {
      if ((set >> i & 1u) == 0) continue;
      active.conservativeResize(Eigen::NoChange, active.cols() + 1);
      active.rightCols(1) = rows.col(i);
      rhs.conservativeResize(rhs.size() + 1);
      rhs[rhs.size() - 1] = b[i];
    }
    if (active.cols() > n) continue;
    VectorXd x = wanted;
    if (active.cols() > 0) {
      const MatrixXd Wa = M.ldlt().solve(active);
      x += Wa * (active.transpose() * Wa).ldlt().solve(rhs - active.transpose() * wanted);
    }
    if (((rows.transpose() * x - b).array() < -1e-9).any()) continue;
    const double cost = (x - wanted).dot(M * (x - wanted));
    if (cost < best_cost) best_cost = cost, best = x;
  }
  return best;
}

}  // namespace

TEST_CASE("the filter finds the nearest admissible velocity in the kinetic metric", "[hybrid][property]") {
  const auto seed = GENERATE(range(1u, 40u));
  CAPTURE(seed);
  Rng rng(seed);
  const int n = 5, m = 6;
  const MatrixXd M = random_mass(rng, n), W = M.inverse();
  MatrixXd rows(n, m);
  VectorXd b(m);
  SafetyFilter filter(n, 16);
  filter.begin(M, W);
  for (int i = 0; i < m; ++i) {
    rows.col(i) = random_vector(rng, n);
    b[i] = -rng.uniform(0.0, 0.3);
    REQUIRE(filter.add_row(rows.col(i), b[i], -std::numeric_limits<double>::infinity()));
  }
  const VectorXd wanted = random_vector(rng, n, 3.0);
  VectorXd x = wanted;
  const auto report = filter.project(x, 20000);
  const VectorXd expected = nearest_by_active_sets(M, wanted, rows, b);
  REQUIRE(expected.size() == n);
  CHECK((x - expected).norm() < 1e-4 * (1.0 + expected.norm()));
  CHECK(report.recovery_J == 0.0);
}

TEST_CASE("kinetic energy never rises where standing still is admitted, after any number of passes",
          "[hybrid][property]") {
  const int passes = GENERATE(1, 2, 5, 12);
  for (std::uint64_t seed = 1; seed <= 2000; ++seed) {
    Rng rng(seed);
    const int n = 1 + static_cast<int>(rng.below(8)), m = static_cast<int>(rng.below(20));
    const MatrixXd M = random_mass(rng, n), W = M.inverse();
    SafetyFilter filter(n, 32);
    filter.begin(M, W);
    for (int i = 0; i < m; ++i)
      (void)filter.add_row(random_vector(rng, n), -rng.uniform(0.0, 1.0), -rng.uniform(0.0, 0.5));
    filter.set_box(VectorXd::Constant(n, -rng.uniform(0.0, 2.0)), VectorXd::Constant(n, rng.uniform(0.0, 2.0)));
    if (seed % 2 == 0)
      filter.set_momentum_box(VectorXd::Constant(n, -rng.uniform(0.0, 2.0)),
                              VectorXd::Constant(n, rng.uniform(0.0, 2.0)));
    VectorXd x = random_vector(rng, n, 3.0);
    const auto report = filter.project(x, passes);
    CAPTURE(seed, passes);
    REQUIRE(report.recovery_J == 0.0);
    REQUIRE(report.energy_after_J <= report.energy_before_J * (1.0 + 1e-12));
  }
}

TEST_CASE("what rows that demand motion add is no more than what is booked as recovery", "[hybrid][property]") {
  for (std::uint64_t seed = 1; seed <= 2000; ++seed) {
    Rng rng(seed);
    const int n = 1 + static_cast<int>(rng.below(7)), m = 1 + static_cast<int>(rng.below(10));
    const MatrixXd M = random_mass(rng, n), W = M.inverse();
    SafetyFilter filter(n, 32);
    filter.begin(M, W);
    for (int i = 0; i < m; ++i) (void)filter.add_row(random_vector(rng, n), rng.uniform(-0.5, 0.5), 1.0);
    const double low = rng.uniform(-1.0, 0.5);
    filter.set_box(VectorXd::Constant(n, low), VectorXd::Constant(n, low + 1.0));
    VectorXd x = random_vector(rng, n, 2.0);
    const auto report = filter.project(x, 1 + static_cast<int>(rng.below(12)));
    CAPTURE(seed);
    const double filter_work = report.energy_after_J - report.energy_before_J - report.recovery_J;
    REQUIRE(filter_work <= 1e-12 * (1.0 + report.energy_before_J + report.recovery_J));
  }
}

TEST_CASE("floors hold after a single pass", "[hybrid][property]") {
  for (std::uint64_t seed = 1; seed <= 500; ++seed) {
    Rng rng(seed);
    const int n = 7, m = 12;
    const MatrixXd M = random_mass(rng, n), W = M.inverse();
    MatrixXd rows(n, m);
    VectorXd floors(m);
    SafetyFilter filter(n, 16);
    filter.begin(M, W);
    for (int i = 0; i < m; ++i) {
      rows.col(i) = random_vector(rng, n);
      floors[i] = -rng.uniform(0.01, 0.2);
      (void)filter.add_row(rows.col(i), 0.5 * floors[i], floors[i]);
    }
    VectorXd x = random_vector(rng, n, 3.0);
    (void)filter.project(x, 1);
    CAPTURE(seed);
    REQUIRE(((rows.transpose() * x - floors).array() > -1e-12).all());
  }
}

#ifndef HAMELIN_SANITIZED
TEST_CASE("projecting does not allocate", "[hybrid][allocation]") {
  Rng rng(1);
  const MatrixXd M = random_mass(rng, 7), W = M.inverse();
  const VectorXd a = random_vector(rng, 7), low = VectorXd::Constant(7, -1.0), high = VectorXd::Constant(7, 1.0);
  VectorXd x = random_vector(rng, 7, 3.0);
  SafetyFilter filter(7, 8);
  CHECK(hamelin::test::allocations_in([&] {
          filter.begin(M, W);
          (void)filter.add_row(a, -0.1, -0.2);
          filter.set_box(low, high);
          filter.set_momentum_box(low, high);
          (void)filter.project(x, 12);
        }) == 0);
}
#endif

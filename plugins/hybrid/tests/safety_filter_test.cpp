#include "../src/safety_filter.hpp"

#include <Eigen/LU>
#include <catch2/catch.hpp>
#include <limits>

#include "random_mass.hpp"

using Eigen::MatrixXd;
using Eigen::VectorXd;
using hamelin::Rng;
using hamelin::hybrid::SafetyFilter;
using hamelin::test::random_mass;
using hamelin::test::random_numbers;

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();

// The nearest admissible point by enumeration of the sets of active rows, independent of the dual
// iteration.
VectorXd nearest_by_active_sets(const MatrixXd& M, const VectorXd& target, const MatrixXd& rows,
                                const VectorXd& b) {
  const auto n = target.size(), m = rows.cols();
  VectorXd best;
  double best_cost = infinite;
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
    VectorXd x = target;
    if (active.cols() > 0) {
      const MatrixXd Wa = M.ldlt().solve(active);
      x += Wa * (active.transpose() * Wa).ldlt().solve(rhs - active.transpose() * target);
    }
    if (((rows.transpose() * x - b).array() < -1e-9).any()) continue;
    const double cost = (x - target).dot(M * (x - target));
    if (cost < best_cost) best_cost = cost, best = x;
  }
  return best;
}

}  // namespace

TEST_CASE("the filter finds the nearest admissible velocity in the metric of kinetic energy",
          "[hybrid][property]") {
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
    rows.col(i) = random_numbers(rng, n);
    b[i] = -rng.uniform(0.0, 0.3);
    REQUIRE(filter.add_row(rows.col(i), b[i], -infinite));
  }
  const VectorXd target = random_numbers(rng, n, 3.0);
  VectorXd x = target;
  const auto report = filter.project(x, 20000);
  const VectorXd expected = nearest_by_active_sets(M, target, rows, b);
  REQUIRE(expected.size() == n);
  CHECK((x - expected).norm() < 1e-4 * (1.0 + expected.norm()));
  CHECK(report.recovery_J == 0.0);
}

TEST_CASE("the filter adds no kinetic energy where rest is admissible, after any number of passes",
          "[hybrid][property]") {
  const int passes = GENERATE(1, 2, 5, 12);
  for (std::uint64_t seed = 1; seed <= 10000; ++seed) {
    Rng rng(seed);
    const int n = 1 + static_cast<int>(rng.below(8)), m = static_cast<int>(rng.below(20));
    const MatrixXd M = random_mass(rng, n), W = M.inverse();
    SafetyFilter filter(n, 32);
    filter.begin(M, W);
    for (int i = 0; i < m; ++i)
      (void)filter.add_row(random_numbers(rng, n), -rng.uniform(0.0, 1.0), -rng.uniform(0.0, 0.5));
    // boxes that contain zero, different for each joint; some bounds are zero
    const auto bound = [&] {
      VectorXd x(n);
      for (auto& one : x) one = rng.uniform() < 0.2 ? 0.0 : rng.uniform(0.0, 2.0);
      return x;
    };
    filter.set_box(-bound(), bound());
    if (seed % 2 == 0) filter.set_momentum_box(-bound(), bound());
    VectorXd x = random_numbers(rng, n, 3.0);
    const VectorXd before = x;
    const auto report = filter.project(x, passes);
    CAPTURE(seed, passes);
    REQUIRE(report.recovery_J == 0.0);
    REQUIRE(x.dot(M * x) <= before.dot(M * before) * (1.0 + 1e-12));
    REQUIRE(report.energy_before_J == Approx(0.5 * before.dot(M * before)));
    REQUIRE(report.energy_after_J == Approx(0.5 * x.dot(M * x)).margin(1e-15));
  }
}

TEST_CASE("rows that demand motion add no more energy than is booked as recovery",
          "[hybrid][property]") {
  for (std::uint64_t seed = 1; seed <= 2000; ++seed) {
    Rng rng(seed);
    const int n = 1 + static_cast<int>(rng.below(7)), m = 1 + static_cast<int>(rng.below(10));
    const MatrixXd M = random_mass(rng, n), W = M.inverse();
    SafetyFilter filter(n, 32);
    filter.begin(M, W);
    for (int i = 0; i < m; ++i)
      (void)filter.add_row(random_numbers(rng, n), rng.uniform(-0.5, 0.5), 1.0);
    const double low = rng.uniform(-1.0, 0.5);
    filter.set_box(VectorXd::Constant(n, low), VectorXd::Constant(n, low + 1.0));
    VectorXd x = random_numbers(rng, n, 2.0);
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
      rows.col(i) = random_numbers(rng, n);
      floors[i] = -rng.uniform(0.01, 0.2);
      (void)filter.add_row(rows.col(i), 0.5 * floors[i], floors[i]);
    }
    VectorXd x = random_numbers(rng, n, 3.0);
    (void)filter.project(x, 1);
    CAPTURE(seed);
    REQUIRE(((rows.transpose() * x - floors).array() > -1e-12).all());
  }
}

// ---- braking room

namespace {

/// Boxes around `from`; some bounds coincide with it, some are infinite.
struct Boxes {
  Boxes(Rng& rng, const MatrixXd& mass, const VectorXd& from)
      : M(mass), low(from), high(from), momentum_low(mass * from), momentum_high(momentum_low) {
    has_momentum = rng.uniform() < 0.7;
    const auto gap = [&](bool may_be_open) {
      const double kind = rng.uniform();
      return kind < 0.1 ? 0.0 : kind < 0.2 && may_be_open ? infinite : rng.uniform(0.0, 1.0);
    };
    // At least one box must be finite.
    for (auto& one : low) one -= gap(has_momentum);
    for (auto& one : high) one += gap(has_momentum);
    for (auto& one : momentum_low) one -= gap(false);
    for (auto& one : momentum_high) one += gap(false);
  }
  [[nodiscard]] bool contains(const VectorXd& x) const {
    const VectorXd p = M * x;
    const auto within = [](const VectorXd& y, const VectorXd& lower, const VectorXd& upper) {
      return ((y - lower).array() >= -1e-12).all() && ((upper - y).array() >= -1e-12).all();
    };
    return within(x, low, high) && (!has_momentum || within(p, momentum_low, momentum_high));
  }
  void set(SafetyFilter& filter) const {
    filter.set_box(low, high);
    if (has_momentum) filter.set_momentum_box(momentum_low, momentum_high);
  }
  const MatrixXd& M;
  VectorXd low, high, momentum_low, momentum_high;
  bool has_momentum = false;
};

/// The largest multiple of a step from a point that stays within the boxes, by bisection.
double reach(const Boxes& boxes, const VectorXd& from, const VectorXd& step, double most) {
  double inside = 0.0, outside = most;
  if (boxes.contains(from + most * step)) return most;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (inside + outside);
    (boxes.contains(from + middle * step) ? inside : outside) = middle;
  }
  return inside;
}

}  // namespace

TEST_CASE("the braking room can be reached within the boxes", "[hybrid][property]") {
  int positive = 0;
  for (std::uint64_t seed = 1; seed <= 3000; ++seed) {
    CAPTURE(seed);
    Rng rng(seed);
    const int n = 1 + static_cast<int>(rng.below(7));
    const MatrixXd M = random_mass(rng, n), W = M.inverse();
    const VectorXd from = random_numbers(rng, n), a = random_numbers(rng, n);
    const Boxes boxes(rng, M, from);
    SafetyFilter filter(n, 4);
    filter.begin(M, W);
    boxes.set(filter);
    const double room = filter.braking_room(a, from);
    REQUIRE(room >= 0.0);
    REQUIRE(std::isfinite(room));

    // One of two points reaches it: along the row, or towards the corner of the box.
    const VectorXd along = M.ldlt().solve(a);
    VectorXd best = from + reach(boxes, from, along, 1e3) * along;
    VectorXd corner(n);
    for (int k = 0; k < n; ++k)
      corner[k] = a[k] > 0.0 ? boxes.high[k] - from[k] : boxes.low[k] - from[k];
    if (corner.allFinite()) {
      const VectorXd other = from + reach(boxes, from, corner, 1.0) * corner;
      if (a.dot(other) > a.dot(best)) best = other;
    }
    REQUIRE(boxes.contains(best));
    REQUIRE(a.dot(best) - a.dot(from) >= room - 1e-9);
    if (room > 1e-6) ++positive;
  }
  CHECK(positive > 1000);
}

TEST_CASE("the filter reaches a row within the braking room", "[hybrid][property]") {
  // A row that demands 0.9 of the room holds together with the boxes.
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    CAPTURE(seed);
    Rng rng(seed);
    const int n = 2 + static_cast<int>(rng.below(3));
    const MatrixXd M = random_mass(rng, n), W = M.inverse();
    const VectorXd from = random_numbers(rng, n), a = random_numbers(rng, n);
    const Boxes boxes(rng, M, from);
    SafetyFilter filter(n, 4);
    filter.begin(M, W);
    boxes.set(filter);
    const double target = a.dot(from) + 0.9 * filter.braking_room(a, from);
    REQUIRE(filter.add_row(a, target, infinite));
    VectorXd x = from;
    (void)filter.project(x, 20000);
    CHECK(a.dot(x) > target - 1e-3);
  }
}

TEST_CASE("the braking room is never negative, at any point", "[hybrid][property]") {
  for (std::uint64_t seed = 1; seed <= 3000; ++seed) {
    CAPTURE(seed);
    Rng rng(seed);
    const int n = 1 + static_cast<int>(rng.below(7));
    const MatrixXd M = random_mass(rng, n), W = M.inverse();
    const Boxes boxes(rng, M, random_numbers(rng, n));
    SafetyFilter filter(n, 4);
    filter.begin(M, W);
    boxes.set(filter);
    REQUIRE(filter.braking_room(random_numbers(rng, n), random_numbers(rng, n, 3.0)) >= 0.0);
  }
}

TEST_CASE("a row that no joint moves has no braking room", "[hybrid]") {
  const MatrixXd M = MatrixXd::Identity(3, 3);
  const VectorXd one = VectorXd::Ones(3), none = VectorXd::Zero(3);
  SafetyFilter filter(3, 4);
  filter.begin(M, M);
  filter.set_box(-one, one);
  filter.set_momentum_box(-one, one);
  CHECK(filter.braking_room(none, none) == 0.0);
}

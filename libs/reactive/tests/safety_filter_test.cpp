#include "hamelin/reactive/safety_filter.hpp"

#include <Eigen/LU>
#include <catch2/catch.hpp>
#include <limits>

#include "hamelin/test/random_mass.hpp"

using Eigen::MatrixXd;
using Eigen::VectorXd;
using hamelin::Rng;
using hamelin::reactive::SafetyFilter;
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
          "[reactive][property]") {
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
          "[reactive][property]") {
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
          "[reactive][property]") {
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

TEST_CASE("floors hold after a single pass", "[reactive][property]") {
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

// ---- soft rows

namespace {

/// Hard and soft rows, with floors of the hard ones.
struct Rows {
  MatrixXd hard, soft;
  VectorXd b_hard, b_soft, floors, softness;
  void add_to(SafetyFilter& filter, bool with_floors = true) const {
    for (Eigen::Index i = 0; i < hard.cols(); ++i)
      (void)filter.add_row(hard.col(i), b_hard[i], with_floors ? floors[i] : 1.0);
    for (Eigen::Index i = 0; i < soft.cols(); ++i)
      (void)filter.add_row(soft.col(i), b_soft[i], 0.0, softness[i]);
  }
};

Rows random_rows(Rng& rng, int n, int hard, int soft) {
  Rows rows{MatrixXd(n, hard), MatrixXd(n, soft), VectorXd(hard),
            VectorXd(soft),    VectorXd(hard),    VectorXd(soft)};
  for (int i = 0; i < hard; ++i) {
    rows.hard.col(i) = random_numbers(rng, n);
    rows.b_hard[i] = -rng.uniform(0.0, 0.3);
    rows.floors[i] = rows.b_hard[i] - rng.uniform(0.01, 0.2);
  }
  for (int i = 0; i < soft; ++i) {
    rows.soft.col(i) = random_numbers(rng, n);
    rows.b_soft[i] = rng.uniform(-0.3, 1.0);
    rows.softness[i] = rng.uniform(0.05, 1.0);
  }
  return rows;
}

// The minimiser of ½|x − ũ|²_M + Σ ξ²/(2ρ) with a·x ≥ b − ξ, as that of a problem with hard rows
// only in (x, ξ), whose metric is M and 1/ρ.
VectorXd nearest_with_soft_rows(const MatrixXd& M, const VectorXd& target, const Rows& rows) {
  const auto n = target.size(), hard = rows.hard.cols(), soft = rows.soft.cols();
  MatrixXd metric = MatrixXd::Zero(n + soft, n + soft), all(n + soft, hard + soft);
  metric.topLeftCorner(n, n) = M;
  all.setZero();
  all.topLeftCorner(n, hard) = rows.hard;
  all.topRightCorner(n, soft) = rows.soft;
  for (Eigen::Index i = 0; i < soft; ++i) {
    const VectorXd a = rows.soft.col(i);
    metric(n + i, n + i) = 1.0 / (rows.softness[i] * a.dot(M.ldlt().solve(a)));
    all(n + i, hard + i) = 1.0;
  }
  VectorXd from = VectorXd::Zero(n + soft), b(hard + soft);
  from.head(n) = target;
  b << rows.b_hard, rows.b_soft;
  return nearest_by_active_sets(metric, from, all, b).head(n);
}

}  // namespace

TEST_CASE("soft rows give way at the price of half the work of their violation",
          "[reactive][property]") {
  int gave_way = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    CAPTURE(seed);
    Rng rng(seed);
    const int n = 4;
    const MatrixXd M = random_mass(rng, n), W = M.inverse();
    const Rows rows = random_rows(rng, n, 3, 3);
    SafetyFilter filter(n, 16);
    filter.begin(M, W);
    rows.add_to(filter);
    const VectorXd target = random_numbers(rng, n, 2.0);
    VectorXd x = target;
    (void)filter.project(x, 20000);
    const VectorXd expected = nearest_with_soft_rows(M, target, rows);
    REQUIRE(expected.size() == n);
    REQUIRE((x - expected).norm() < 1e-4 * (1.0 + expected.norm()));
    // The violation of a soft row is ρλ.
    for (int i = 0; i < 3; ++i) {
      const VectorXd a = rows.soft.col(i);
      const double lambda = filter.row_multiplier(3 + i);
      if (lambda < 0.01) continue;
      ++gave_way;
      REQUIRE(a.dot(x) ==
              Approx(rows.b_soft[i] - rows.softness[i] * a.dot(W * a) * lambda).margin(1e-3));
    }
  }
  CHECK(gave_way > 50);
}

TEST_CASE("soft rows add no more energy than is booked as recovery, after any number of passes",
          "[reactive][property]") {
  const int passes = GENERATE(1, 2, 5, 12);
  int projected_twice = 0;
  for (std::uint64_t seed = 1; seed <= 3000; ++seed) {
    CAPTURE(seed, passes);
    Rng rng(seed);
    const int n = 1 + static_cast<int>(rng.below(7)), hard = static_cast<int>(rng.below(8)),
              soft = 1 + static_cast<int>(rng.below(8));
    const MatrixXd M = random_mass(rng, n), W = M.inverse();
    const Rows rows = random_rows(rng, n, hard, soft);
    SafetyFilter filter(n, 32);
    filter.begin(M, W);
    rows.add_to(filter);
    const VectorXd one = VectorXd::Constant(n, rng.uniform(0.2, 2.0));
    filter.set_box(-one, one);
    if (seed % 2 == 0) filter.set_momentum_box(-one, one);
    VectorXd x = random_numbers(rng, n, 2.0);
    const auto report = filter.project(x, passes);
    projected_twice += report.passes > passes ? 1 : 0;
    double paid = 0.0;  // ½ Σ ρ λ² of the last projection
    for (int i = 0; i < soft; ++i) {
      const VectorXd a = rows.soft.col(i);
      const double lambda = filter.row_multiplier(hard + i);
      paid += 0.5 * rows.softness[i] * a.dot(W * a) * lambda * lambda;
    }
    const double work = report.energy_after_J - report.energy_before_J - report.recovery_J;
    REQUIRE(report.recovery_J >= 0.0);
    REQUIRE(work <= -paid + 1e-12 * (1.0 + report.energy_before_J + report.recovery_J));
    REQUIRE(report.energy_after_J == Approx(0.5 * x.dot(M * x)).margin(1e-15));
  }
  CHECK(projected_twice > 100);
}

TEST_CASE("where soft rows break floors of hard ones, a second projection has none of them",
          "[reactive][property]") {
  // Soft rows push the arm into walls with a larger demand than the passes can resolve.
  constexpr int n = 7, hard = 6, soft = 6, passes = 3;
  int twice = 0;
  for (std::uint64_t seed = 1; seed <= 2000; ++seed) {
    CAPTURE(seed);
    Rng rng(seed);
    const MatrixXd M = random_mass(rng, n), W = M.inverse();
    Rows rows = random_rows(rng, n, hard, soft);
    for (int i = 0; i < soft; ++i) {
      rows.soft.col(i) = random_numbers(rng, n, 0.2) - rows.hard.col(i);
      rows.b_soft[i] = rng.uniform(0.5, 3.0);
    }
    const VectorXd one = VectorXd::Constant(n, 3.0);
    SafetyFilter filter(n, 32), first(n, 32), second(n, 32);
    for (auto* each : {&filter, &first, &second}) {
      each->begin(M, W);
      each->set_box(-one, one);
    }
    rows.add_to(filter);
    rows.add_to(first, false);
    for (int i = 0; i < hard; ++i)
      (void)second.add_row(rows.hard.col(i), rows.b_hard[i], rows.floors[i]);

    VectorXd x = random_numbers(rng, n, 2.0), expected = x;
    const auto report = filter.project(x, passes);
    REQUIRE((rows.hard.transpose() * x - rows.floors).minCoeff() > -1e-9);
    const double work = report.energy_after_J - report.energy_before_J - report.recovery_J;
    REQUIRE(work <= 1e-12 * (1.0 + report.energy_before_J + report.recovery_J));

    // The same by two filters, without floors in the first.
    auto recovery = first.project(expected, passes).recovery_J;
    double scale = 1.0;
    const bool broken = (rows.hard.transpose() * expected - rows.floors).minCoeff() < -1e-9;
    if (broken) {
      ++twice;
      const auto again = second.project(expected, 2 * passes);
      recovery += again.recovery_J;
      scale = again.scale;
    }
    REQUIRE((x - expected).norm() < 1e-12 * (1.0 + expected.norm()));
    REQUIRE(report.recovery_J == Approx(recovery));
    REQUIRE(report.scale == scale);
  }
  CHECK(twice > 500);
}

TEST_CASE("a wall that soft rows push against is kept without scaling the rest of the velocity",
          "[reactive][property]") {
  // The second projection onto a single wall is exact.
  int twice = 0;
  for (std::uint64_t seed = 1; seed <= 2000; ++seed) {
    CAPTURE(seed);
    Rng rng(seed);
    constexpr int n = 7, soft = 5;
    const int passes = 1 + static_cast<int>(rng.below(3));
    const MatrixXd M = random_mass(rng, n), W = M.inverse();
    Rows rows = random_rows(rng, n, 1, soft);
    for (int i = 0; i < soft; ++i) {
      rows.soft.col(i) = random_numbers(rng, n, 0.2) - rows.hard.col(0);
      rows.b_soft[i] = rng.uniform(0.5, 3.0);
    }
    SafetyFilter filter(n, 16);
    filter.begin(M, W);
    rows.add_to(filter);
    VectorXd x = random_numbers(rng, n, 2.0);
    const auto report = filter.project(x, passes);
    twice += report.passes > passes ? 1 : 0;
    REQUIRE(report.scale == 1.0);
    REQUIRE(rows.hard.col(0).dot(x) > rows.floors[0] - 1e-9);
    const double work = report.energy_after_J - report.energy_before_J - report.recovery_J;
    REQUIRE(work <= 1e-12 * (1.0 + report.energy_before_J + report.recovery_J));
  }
  CHECK(twice > 1000);

  const MatrixXd M = MatrixXd::Identity(3, 3);
  SafetyFilter filter(3, 8);
  filter.begin(M, M);
  REQUIRE(filter.add_row(Eigen::Vector3d(1.0, 0.0, 0.0), -0.01, -0.02));
  REQUIRE(filter.add_row(Eigen::Vector3d(-1.0, 0.0, 0.0), 3.0, 0.0, 0.2));
  VectorXd x = Eigen::Vector3d(0.0, 0.0, 0.7);
  (void)filter.project(x, 2);
  CHECK(x.isApprox(Eigen::Vector3d(-0.01, 0.0, 0.7)));
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

TEST_CASE("the braking room can be reached within the boxes", "[reactive][property]") {
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

TEST_CASE("the filter reaches a row within the braking room", "[reactive][property]") {
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

TEST_CASE("the braking room is never negative, at any point", "[reactive][property]") {
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

TEST_CASE("a row that no joint moves has no braking room", "[reactive]") {
  const MatrixXd M = MatrixXd::Identity(3, 3);
  const VectorXd one = VectorXd::Ones(3), none = VectorXd::Zero(3);
  SafetyFilter filter(3, 4);
  filter.begin(M, M);
  filter.set_box(-one, one);
  filter.set_momentum_box(-one, one);
  CHECK(filter.braking_room(none, none) == 0.0);
}

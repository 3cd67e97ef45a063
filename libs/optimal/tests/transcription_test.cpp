#include "../src/transcription.hpp"

#include <catch2/catch.hpp>

#include "hamelin/model/make_chain.hpp"
#include "hamelin/optimal/solve.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::optimal;

namespace {

Problem problem_of(const model::Model& arm, Objective objective) {
  const Index n = arm.dof();
  Problem p;
  p.model = &arm;
  p.q_start = VectorXd::LinSpaced(n, -0.3, 0.5);
  p.q_goal = VectorXd::LinSpaced(n, 0.4, -0.6);
  p.v_start = VectorXd::Constant(n, 0.1);
  p.v_goal = VectorXd::Constant(n, -0.2);
  p.intervals = 8;
  p.objective = objective;
  p.duration_s = 0.8;
  p.limits.position_min = VectorXd::Constant(n, -2.0);
  p.limits.position_max = VectorXd::Constant(n, 2.0);
  p.limits.velocity = VectorXd::Constant(n, 3.0);
  p.limits.acceleration = VectorXd::Constant(n, 20.0);
  p.limits.jerk = VectorXd::Constant(n, 300.0);
  p.limits.torque = VectorXd::Constant(n, 50.0);
  return p;
}

MatrixXd dense(const BandedMatrix& H, Index n) {
  const Index size = H.blocks() * n;
  MatrixXd out = MatrixXd::Zero(size + (H.bordered() ? 1 : 0), size + (H.bordered() ? 1 : 0));
  for (Index c = 0; c < H.blocks(); ++c)
    for (Index r = c; r < std::min(H.blocks(), c + H.reach() + 1); ++r)
      out.block(r * n, c * n, n, n) = H.block(r, c);
  if (H.bordered()) {
    out.row(size).head(size) = H.border().transpose();
    out(size, size) = H.corner();
  }
  return out.selfadjointView<Eigen::Lower>();
}

}  // namespace

TEST_CASE("derivatives of cost and rows agree with differences", "[optimal]") {
  const auto objective = GENERATE(Objective::effort, Objective::time);
  const model::Model arm(test::random_robot(3, 4, 3));
  Problem problem = problem_of(arm, objective);
  const bool jerk = GENERATE(false, true);
  const Index inner = jerk ? 5 : 7;
  if (!jerk) problem.limits.jerk.resize(0);
  Transcription program(problem);
  Rng rng(5);
  MatrixXd knots = guess_along((MatrixXd(4, 2) << problem.q_start, problem.q_goal).finished(), 8);
  for (Index k = 0; k <= 8; ++k) knots.col(k) += test::random_joints(rng, 4, 0.1);
  const VectorXd x = program.variables_of(knots);
  REQUIRE(program.evaluate(x));
  const Index m = program.rows(), size = program.variables();
  REQUIRE(m == 4 * (inner + 8 + 9 + (jerk ? 8 : 0) + 9));
  VectorXd gradient(size);
  program.gradient(gradient);
  MatrixXd J = MatrixXd::Zero(m, size);
  program.for_each_entry([&](Index r, Index v, double d) { J(r, v) += d; });
  VectorXd y(m), weights = VectorXd::Zero(m);
  for (Index r = 0; r < m; ++r) y[r] = std::sin(1.0 + static_cast<double>(r));
  BandedMatrix H = program.hessian_matrix();
  program.hessian(0.7, y, weights, true, H);
  const MatrixXd lagrangian = dense(H, 4);
  weights.setConstant(0.3);
  program.hessian(0.7, y, weights, true, H);
  const MatrixXd with_weights = dense(H, 4) - lagrangian;
  CHECK((with_weights - 0.3 * J.transpose() * J).norm() <= 1e-8 * with_weights.norm());

  MatrixXd slopes(m, size), second(size, size);
  VectorXd cost_slopes(size);
  constexpr double step = 1e-5;
  for (Index v = 0; v < size; ++v) {
    const auto at = [&](double change) {
      VectorXd moved = x;
      moved[v] += change;
      REQUIRE(program.evaluate(moved));
      VectorXd g(size);
      program.gradient(g);
      g *= 0.7;
      program.for_each_entry([&](Index r, Index i, double d) { g[i] += d * y[r]; });
      return std::tuple(program.cost(), VectorXd(program.values()), g);
    };
    const auto [cost_ahead, rows_ahead, g_ahead] = at(step);
    const auto [cost_back, rows_back, g_back] = at(-step);
    cost_slopes[v] = (cost_ahead - cost_back) / (2.0 * step);
    slopes.col(v) = (rows_ahead - rows_back) / (2.0 * step);
    second.col(v) = (g_ahead - g_back) / (2.0 * step);
  }
  CHECK((gradient - cost_slopes).norm() <= 1e-7 * gradient.norm());
  CHECK((J - slopes).norm() <= 1e-7 * J.norm());
  CHECK((lagrangian - second).norm() <= 1e-6 * lagrangian.norm());
}

TEST_CASE("both solvers find the same motion", "[optimal]") {
  const auto objective = GENERATE(Objective::effort, Objective::time);
  const model::Model arm(test::random_robot(3, 4, 3));
  Problem problem = problem_of(arm, objective);
  problem.intervals = 40;
  const MatrixXd guess =
      guess_along((MatrixXd(4, 2) << problem.q_start, problem.q_goal).finished(), 40);
  const Solution found = solve(problem, guess);
  CAPTURE(found.cause, found.iterations, found.violation, found.stationarity, found.cost);
  CHECK(found.converged);
  CHECK(found.violation == 0.0);
  if (!has_ipopt()) return;
  SolveOptions options;
  options.solver = Solver::ipopt;
  const Solution reference = solve(problem, guess, options);
  CAPTURE(reference.cause, reference.iterations, reference.cost);
  CHECK(reference.converged);
  CHECK(found.cost == Approx(reference.cost).epsilon(1e-6));
  CHECK((found.control - reference.control).norm() <= 1e-2);
  WARN(found.iterations << " " << reference.iterations << " cost " << found.cost << " "
                        << reference.cost << " dq " << (found.control - reference.control).norm());
}

#include "../src/transcription.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <tuple>

#include "hamelin/model/make_chain.hpp"
#include "hamelin/optimal/solve.hpp"
#include "hamelin/optimal/timed_motion.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/robots.hpp"
#include "hamelin/test/skip.hpp"
#ifdef HAMELIN_HAS_IPOPT
#include "../bench/ipopt_solver.hpp"
#endif

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
  const Index step_row = objective == Objective::time ? 1 : 0;
  REQUIRE(m == 4 * (inner + 8 + 9 + (jerk ? 8 : 0) + 9) + step_row);
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
  // the cost is flat around its minimum: a barrier of 1e-8 moves control points by 0.01
  SolveOptions options;
  options.tolerance = 1e-10;
  const Solution found = solve(problem, guess, options);
  CAPTURE(found.cause, found.iterations, found.violation, found.stationarity, found.cost);
  CHECK(found.converged);
  CHECK(found.violation == 0.0);
#ifdef HAMELIN_HAS_IPOPT
  const Solution reference = solve_by_ipopt(problem, guess, options);
  CAPTURE(reference.cause, reference.iterations, reference.cost);
  CHECK(reference.converged);
  CHECK(found.cost == Approx(reference.cost).epsilon(1e-9));
  CHECK((found.control - reference.control).norm() <= 1e-4);
#else
  test::skip("this build is without Ipopt");
#endif
}

TEST_CASE("a motion keeps its limits at all times and its ends exactly", "[optimal]") {
  const bool jerk = GENERATE(false, true);
  const model::Model arm(test::random_robot(3, 4, 3));
  Problem problem = problem_of(arm, Objective::time);
  if (!jerk) problem.limits.jerk.resize(0);
  problem.intervals = 30;
  const Solution found = solve(
      problem, guess_along((MatrixXd(4, 2) << problem.q_start, problem.q_goal).finished(), 30));
  REQUIRE(found.converged);
  const TimedMotion motion{found.step_s, found.control};
  VectorXd q, v, a, q_before, v_before, a_before;
  motion.at(0.0, q, v, a);
  CHECK((q - problem.q_start).norm() <= 1e-14);
  CHECK((v - problem.v_start).norm() <= 1e-12);
  if (jerk) CHECK(a.norm() <= 1e-10);
  motion.at(motion.duration_s(), q, v, a);
  CHECK((q - problem.q_goal).norm() <= 1e-14);
  CHECK((v - problem.v_goal).norm() <= 1e-12);
  constexpr int samples = 1000;
  const double dt = motion.duration_s() / samples;
  double fastest = 0.0;
  for (int i = 0; i <= samples; ++i) {
    motion.at(dt * i, q, v, a);
    CHECK((q.cwiseAbs().array() <= 2.0).all());
    CHECK((v.cwiseAbs().array() <= 3.0).all());
    CHECK((a.cwiseAbs().array() <= 20.0).all());
    fastest =
        std::max({fastest, v.lpNorm<Eigen::Infinity>() / 3.0, a.lpNorm<Eigen::Infinity>() / 20.0});
    if (i > 0) {  // v is the derivative of q, and a that of v
      CHECK((q - q_before - 0.5 * dt * (v + v_before)).norm() <= 300.0 * dt * dt * dt);
      CHECK((v - v_before - 0.5 * dt * (a + a_before)).norm() <= 1e-9 + 4e3 * dt * dt);
    }
    q_before = q, v_before = v, a_before = a;
  }
  CHECK(fastest > 0.9);  // some limit binds
}

TEST_CASE("torques by the discrete equations converge to those along the motion", "[optimal]") {
  const model::Model arm(test::random_robot(3, 4, 3));
  dynamics::Workspace ws(arm);
  const auto difference = [&](int intervals) {
    Problem problem = problem_of(arm, Objective::effort);
    problem.limits = {};
    problem.intervals = intervals;
    const Solution found = solve(
        problem,
        guess_along((MatrixXd(4, 2) << problem.q_start, problem.q_goal).finished(), intervals));
    REQUIRE(found.converged);
    const TimedMotion motion{found.step_s, found.control};
    double most = 0.0;
    VectorXd torque;
    for (Index k = 1; k < intervals; ++k) {
      torque_at(arm, ws, motion, found.step_s * static_cast<double>(k), torque);
      most = std::max(most, (torque - found.torque.col(k)).norm());
    }
    return most / found.torque.norm() * std::sqrt(static_cast<double>(intervals));
  };
  const double coarse = difference(20), fine = difference(80);
  CHECK(coarse < 0.2);
  CHECK(std::log2(coarse / fine) / 2.0 == Approx(2.0).margin(0.4));  // second order
}

TEST_CASE("problems without a solution are refused in one line that names the constraint",
          "[optimal]") {
  const model::Model arm(test::random_robot(3, 4, 3));
  const Problem good = problem_of(arm, Objective::effort);
  const MatrixXd guess =
      guess_along((MatrixXd(4, 2) << good.q_start, good.q_goal).finished(), good.intervals);
  const auto message = [&](auto&& change) {
    Problem problem = good;
    change(problem);
    return test::error_of([&] { (void)solve(problem, guess); });
  };
  using Catch::Contains;
  CHECK(message([](Problem&) {}) == "no error");
  CHECK_THAT(message([](Problem& p) { p.intervals = 3; }), Contains("3 intervals"));
  CHECK_THAT(message([](Problem& p) { p.duration_s = 0.0; }), Contains("duration of 0 s"));
  CHECK_THAT(message([](Problem& p) { p.q_start[1] = 2.5; }),
             Contains("start") && Contains("position of joint 2"));
  CHECK_THAT(message([](Problem& p) { p.v_goal[2] = -4.0; }),
             Contains("goal") && Contains("velocity of joint 3"));
  CHECK_THAT(message([](Problem& p) { p.q_goal[0] = std::nan(""); }), Contains("not finite"));
  CHECK_THAT(message([](Problem& p) { p.q_goal.resize(3); }), Contains("3 numbers"));
  CHECK_THAT(message([](Problem& p) { p.limits.torque.setConstant(1.0); }),
             Contains("to hold the arm"));
  CHECK_THAT(message([](Problem& p) { p.limits.jerk[3] = -1.0; }),
             Contains("jerk limits") && Contains("joint 4"));
  CHECK_THAT(message([](Problem& p) { p.effort_weights = VectorXd::Zero(4); }),
             Contains("weights of the effort"));
  const double nan = std::nan("");
  CHECK_THAT(message([](Problem& p) { p.model = nullptr; }), Contains("model"));
  CHECK_THAT(message([&](Problem& p) { p.margin_m = nan; }), Contains("margin: nan"));
  CHECK_THAT(message([](Problem& p) { p.margin_m = -0.01; }), Contains("margin: -0.01"));
  CHECK_THAT(message([](Problem& p) { p.reserve_m = -1.0; }), Contains("reserve of the margin"));
  CHECK_THAT(message([](Problem& p) { p.clearance_points = -3; }),
             Contains("-3 points of clearance"));
  CHECK_THAT(message([](Problem& p) { p.time_effort_weight = -1.0; }), Contains("weight"));
  CHECK_THAT(message([&](Problem& p) { p.time_effort_weight = nan; }), Contains("weight"));
  CHECK_THAT(message([&](Problem& p) { p.begin_s = nan; }), Contains("begins at nan"));
  CHECK_THAT(message([&](Problem& p) { p.limits.position_min[2] = nan; }),
             Contains("position of joint 3"));
  CHECK_THAT(message([](Problem& p) {
               p.objective = Objective::time;
               p.duration_s = 0.5 * least_duration_s;
             }),
             Contains("first guess"));
  CHECK_THAT(message([](Problem& p) { p.torque_reserve = MatrixXd::Zero(4, 3); }),
             Contains("reserve of torques: 4 × 3"));
  CHECK_THAT(message([](Problem& p) { p.torque_reserve = MatrixXd::Constant(4, 9, 50.0); }),
             Contains("less than the limit 50"));

  Problem hurried = good;
  hurried.duration_s = 0.1;
  const Solution none = solve(hurried, guess);
  CHECK_FALSE(none.converged);
  CHECK(none.violation > 0.1);
  CHECK_THAT(none.violated, Contains(" of joint "));
  CHECK_THAT(none.cause, !Contains("\n"));
}

TEST_CASE("guesses and options that are none are refused in one line", "[optimal]") {
  const model::Model arm(test::random_robot(3, 4, 3));
  const Problem problem = problem_of(arm, Objective::effort);
  const MatrixXd ends = (MatrixXd(4, 2) << problem.q_start, problem.q_goal).finished(),
                 guess = guess_along(ends, problem.intervals);
  using Catch::Contains;
  const auto solved_from = [&](const MatrixXd& from, const SolveOptions& options = {}) {
    return test::error_of([&] { (void)solve(problem, from, options); });
  };
  CHECK_THAT(solved_from(guess_along(ends, 7)), Contains("guess: 4 × 8") && Contains("4 × 9"));
  CHECK_THAT(solved_from(MatrixXd::Zero(3, 3)), Contains("guess: 3 × 3"));
  MatrixXd broken = guess;
  broken(1, 4) = std::nan("");
  CHECK_THAT(solved_from(broken), Contains("guess: a number is not finite"));
  SolveOptions options;
  options.tolerance = std::nan("");
  CHECK_THAT(solved_from(guess, options), Contains("tolerance of nan"));
  options = {};
  options.iterations_max = -1;
  CHECK_THAT(solved_from(guess, options), Contains("-1 iterations"));
  const auto along = [](const MatrixXd& points, int intervals) {
    return test::error_of([&] { (void)guess_along(points, intervals); });
  };
  CHECK_THAT(along(ends.leftCols(1), 8), Contains("way-points: 4 × 1"));
  CHECK_THAT(along(broken, 8), Contains("way-points: a number is not finite"));
  CHECK_THAT(along(ends, 0), Contains("0 intervals"));
}

TEST_CASE("a program that has no finite numbers is violated without bound", "[optimal]") {
  const model::Model arm(test::random_robot(3, 4, 3));
  const Problem problem = problem_of(arm, Objective::time);
  Transcription program(problem);
  CHECK(std::isinf(program.violation()));  // nothing is evaluated
  VectorXd x = program.variables_of(
      guess_along((MatrixXd(4, 2) << problem.q_start, problem.q_goal).finished(), 8));
  REQUIRE(program.evaluate(x));
  CHECK(std::isfinite(program.violation()));
  x[program.layout().step_variable()] = 1e-4;  // 0.08 ms: shorter than any motion
  REQUIRE(program.evaluate(x));
  CHECK(program.violation() > 0.0);
  x[program.layout().step_variable()] = -0.1;
  CHECK_FALSE(program.evaluate(x));
  CHECK(std::isinf(program.violation()));
  x[program.layout().step_variable()] = 1.0;
  x[3] = std::nan("");
  CHECK_FALSE(program.evaluate(x));
  CHECK(std::isinf(program.violation()));
}

TEST_CASE("the least time where the goal is the start is the least duration, at rest",
          "[optimal]") {
  const model::Model arm(test::random_robot(3, 4, 3));
  Problem problem = problem_of(arm, Objective::time);
  problem.q_goal = problem.q_start;
  problem.v_start.setZero();
  problem.v_goal.setZero();
  SolveOptions options;
  const Solution found =
      solve(problem, guess_along((MatrixXd(4, 2) << problem.q_start, problem.q_goal).finished(), 8),
            options);
  const TimedMotion motion{found.step_s, found.control};
  CHECK(found.violation <= options.tolerance);
  CHECK(motion.duration_s() == Approx(least_duration_s).epsilon(1e-3));
  CHECK((motion.control.colwise() - problem.q_start).norm() <= 1e-6);
}

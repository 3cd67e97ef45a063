#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>

#include "../src/filter.hpp"
#include "../src/interior_point.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/optimal/solve.hpp"
#include "hamelin/test/skip.hpp"
#ifdef HAMELIN_HAS_IPOPT
#include "../bench/ipopt_solver.hpp"
#endif

using namespace hamelin;
using namespace hamelin::optimal;

TEST_CASE("a filter accepts less cost or less violation than all its points have", "[optimal]") {
  Filter filter;
  filter.reset(1.0);
  const Filter::Point now{0.5, 1.0};
  CHECK(filter.accept(now, {0.4, 3.0}, 1.0, 1.0));  // less violation: `now` enters the filter
  // more cost and violation than a point of the filter, although less than those of the iterate
  CHECK_FALSE(filter.accept({0.6, 2.0}, {0.55, 1.5}, 1.0, 1.0));
  CHECK(filter.accept({0.6, 2.0}, {0.55, 0.9}, 1.0, 1.0));
  // a little more violation is accepted for less cost; a merit with a penalty of 1 refuses this
  // step
  filter.reset(1.0);
  CHECK(filter.accept({0.0, 1.0}, {1e-3, 1.0 - 1e-4}, -1.5e-4, 1.0));
  // without violation, the cost must decrease as the slope promises
  filter.reset(1.0);
  CHECK_FALSE(filter.accept({0.0, 1.0}, {0.0, 1.0 - 1e-6}, -0.1, 1.0));
  CHECK(filter.accept({0.0, 1.0}, {0.0, 1.0 - 1e-4}, -0.1, 1.0));
  // never much more violation than at the guess, nor a cost that is not finite
  CHECK_FALSE(filter.accept({0.0, 1.0}, {2e4, -1e9}, -0.1, 1.0));
  CHECK_FALSE(filter.accept({0.0, 1.0}, {0.0, std::nan("")}, -0.1, 1.0));
}

TEST_CASE("active torque limits do not shorten the steps to the least time of a Panda",
          "[optimal]") {
  const int intervals = GENERATE(10, 20, 50, 100);
  description::RobotOptions options;
  options.tip = "panda_grasptarget";
  const auto robots = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data" / "robots";
  const model::Model panda(description::read_robot(robots / "third_party" / "panda.urdf", options));
  Problem problem;
  problem.model = &panda;
  problem.objective = Objective::time;
  problem.intervals = intervals;
  problem.duration_s = 0.6;
  problem.limits = Limits::of(panda);
  const VectorXd middle = 0.5 * (problem.limits.position_min + problem.limits.position_max);
  problem.q_start = middle + VectorXd::LinSpaced(7, -0.4, 0.3);
  problem.q_goal = middle + VectorXd::LinSpaced(7, 0.3, -0.4);
  problem.v_start = problem.v_goal = VectorXd::Zero(7);
  const MatrixXd ends = (MatrixXd(7, 2) << problem.q_start, problem.q_goal).finished();
  const Solution found = solve(problem, guess_along(ends, intervals));
  CAPTURE(found.cause, found.iterations);
  CHECK(found.converged);
  CHECK(found.violation == 0.0);
  CHECK(found.iterations <= 40);  // 40, 111, 71 and 103 with a merit that adds the violation
  if (intervals > 20) return;     // with more, Ipopt takes too long here
#ifdef HAMELIN_HAS_IPOPT
  CHECK(found.cost ==
        Approx(solve_by_ipopt(problem, guess_along(ends, intervals), {}).cost).epsilon(1e-6));
#else
  test::skip("this build is without Ipopt");
#endif
}

namespace {

// Torques that suffice only for a longer motion: no start finds one without violation.
Problem hurried_problem(const model::Model& arm) {
  Problem problem;
  problem.model = &arm;
  problem.q_start = VectorXd::LinSpaced(7, -0.8, 0.6);
  problem.q_goal = VectorXd::LinSpaced(7, 0.7, -0.9);
  problem.v_start = problem.v_goal = VectorXd::Zero(7);
  problem.intervals = 10;
  problem.duration_s = 0.2;
  problem.limits.velocity = VectorXd::Constant(7, 3.0);
  problem.limits.torque = VectorXd::Constant(7, 60.0);
  return problem;
}

}  // namespace

TEST_CASE("of the starts of the banded solver the least violating one is returned", "[optimal]") {
  const model::Model arm(model::make_chain({}));
  const Problem problem = hurried_problem(arm);
  const MatrixXd guess =
      guess_along((MatrixXd(7, 2) << problem.q_start, problem.q_goal).finished(), 10);
  SolveOptions options;
  options.iterations_max = GENERATE(3, 10, 40);
  const Solution found = solve(problem, guess, options);
  using Start = InteriorPoint::Start;
  double least = infinity, last = infinity;
  for (const Start& start :
       {Start{0.1, 1.0}, Start{0.03, 0.01}, Start{0.1, 0.01}, Start{0.1, 0.1}}) {
    Transcription program(problem);
    (void)InteriorPoint(program, options, start).solve(program.variables_of(guess));
    last = program.violation();
    least = std::min(least, last);
  }
  CAPTURE(least, last, options.iterations_max);
  REQUIRE(least > 0.0);
  CHECK(found.violation == least);
}

TEST_CASE("a trial that was rejected is not kept as the iterate", "[optimal]") {
  // Distances that are finite at the guess alone, so that every step is rejected.
  struct AtTheGuess final : Clearance {
    std::vector<VectorXd> known;
    bool learning = true;
    VectorXd bound = VectorXd::Ones(1);
    [[nodiscard]] Index rows() const override { return 1; }
    [[nodiscard]] const VectorXd& far() const override { return bound; }
    void evaluate(const VectorXd& q, NearDistances& near) override {
      near.clear();
      if (learning) known.push_back(q);
      const bool found = std::find(known.begin(), known.end(), q) != known.end();
      if (!found) near.add(0, std::nan(""), VectorXd::Zero(7));
    }
  } clearance;
  const model::Model arm(model::make_chain({}));
  Problem problem = hurried_problem(arm);
  problem.objective = GENERATE(Objective::effort, Objective::time);
  problem.clearance = &clearance;
  Transcription program(problem);
  const VectorXd x = program.variables_of(
      guess_along((MatrixXd(7, 2) << problem.q_start, problem.q_goal).finished(), 10));
  REQUIRE(program.evaluate(x));
  clearance.learning = false;
  InteriorPoint solver(program, {}, {0.1, 1.0});
  CHECK_FALSE(solver.solve(x).converged);
  CHECK(solver.x() == x);
  CHECK(program.values().allFinite());
  CHECK(std::isfinite(program.violation()));
}

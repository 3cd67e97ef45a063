#include <catch2/catch.hpp>

#include "hamelin/model/make_chain.hpp"
#include "hamelin/optimal/solve.hpp"
#include "hamelin/optimal/timed_motion.hpp"
#include "hamelin/test/readme.hpp"

using namespace hamelin;
using namespace hamelin::optimal;

TEST_CASE("the README's example is optimal and symmetric in its limits", "[optimal]") {
  // clang-format off
  // [example]
const model::Model arm(model::make_chain({}));  // seven links of 0.2 m, gravity along -z
Problem problem;
problem.model = &arm;
problem.q_start = VectorXd::Constant(7, 0.2);
problem.q_goal = VectorXd::Constant(7, -0.3);
problem.v_start = problem.v_goal = VectorXd::Zero(7);
problem.intervals = 40;
problem.objective = Objective::time;
problem.limits.velocity = VectorXd::Constant(7, 3.0);
problem.limits.torque = VectorXd::Constant(7, 60.0);
MatrixXd way_points(7, 2);
way_points << problem.q_start, problem.q_goal;
const Solution fastest = solve(problem, guess_along(way_points, problem.intervals));
const TimedMotion motion{fastest.step_s, fastest.control};
VectorXd q, v, a;
motion.at(0.5 * motion.duration_s(), q, v, a);  // halfway
  // [example]
  // clang-format on
  CHECK(fastest.converged);
  CHECK(fastest.violation == 0.0);
  CHECK(v.lpNorm<Eigen::Infinity>() <= 3.0);
  test::check_readme_example("libs/optimal");
}

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <filesystem>

#include "execution.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/optimal/optimize.hpp"
#ifdef HAMELIN_HAS_IPOPT
#include "ipopt_solver.hpp"
#include "trapezoidal.hpp"
#endif

using namespace hamelin;
using namespace hamelin::optimal;

namespace {

using Eigen::Index;

// The middle of the ranges of the joints, 0 for joints without limits.
VectorXd middle_of(const model::Model& model) {
  const Limits limits = Limits::of(model);
  VectorXd out = VectorXd::Zero(model.dof());
  for (Index j = 0; j < out.size(); ++j)
    if (std::isfinite(limits.position_min[j]) && std::isfinite(limits.position_max[j]))
      out[j] = 0.5 * (limits.position_min[j] + limits.position_max[j]);
  return out;
}

struct Row {
  bool converged = false;
  double cost = 0.0, time_s = 0.0, error = 0.0, held_error = 0.0, motion_error = 0.0,
         milliseconds = 0.0;
  int iterations = 0;
};

template <class F>
double milliseconds_of(F&& f) {
  const auto start = std::chrono::steady_clock::now();
  f();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

Row discrete_mechanics(const Problem& problem, const MatrixXd& guess,
                       Solution (*solver)(const Problem&, const MatrixXd&, const SolveOptions&)) {
  Solution found;
  Row row;
  row.milliseconds = milliseconds_of([&] { found = solver(problem, guess, {}); });
  row.converged = found.converged;
  row.cost = found.cost;
  row.iterations = found.iterations;
  row.time_s = found.step_s * problem.intervals;
  row.error = executed_error(problem, found.torque, found.step_s, false);
  row.held_error = executed_error(problem, found.torque, found.step_s, true);
  row.motion_error = motion_error(problem, found);
  return row;
}

#ifdef HAMELIN_HAS_IPOPT
Row trapezoidal(const Problem& problem, const MatrixXd& guess) {
  Trapezoidal program(problem);
  Row row;
  SolveOptions options;
  options.iterations_max = 300;
  IpoptResult found;
  row.milliseconds =
      milliseconds_of([&] { found = solve_by_ipopt(program, program.guess(guess), options); });
  row.converged = found.converged;
  row.cost = program.cost();
  row.iterations = found.iterations;
  row.time_s = program.step_s() * problem.intervals;
  row.error = executed_error(problem, program.torques(), program.step_s(), false);
  row.held_error = executed_error(problem, program.torques(), program.step_s(), true);
  return row;
}

#endif

void print(const char* robot, const Problem& problem, const char* method, const Row& row) {
  fmt::print(
      "{:<12} {:<7} {:>4} {:<30} {:>13.8f} {:>10.6f} {:>11.2e} {:>11.2e} {:>11.2e} {:>6} "
      "{:>9.1f}{}\n",
      robot, problem.objective == Objective::time ? "time" : "effort", problem.intervals, method,
      row.cost, row.time_s, row.error, row.held_error, row.motion_error, row.iterations,
      row.milliseconds, row.converged ? "" : "  not converged");
}

// Across the middle of the ranges, with torques of at most 300 Nm.
Problem problem_of(const model::Model& model, Objective objective, int intervals) {
  const Index n = model.dof();
  Problem problem;
  problem.model = &model;
  problem.objective = objective;
  problem.intervals = intervals;
  problem.duration_s = 0.6;
  problem.q_start = middle_of(model) + VectorXd::LinSpaced(n, -0.4, 0.3);
  problem.q_goal = middle_of(model) + VectorXd::LinSpaced(n, 0.3, -0.4);
  problem.v_start = problem.v_goal = VectorXd::Zero(n);
  problem.limits = Limits::of(model);
  const VectorXd strength = VectorXd::Constant(n, 300.0);
  problem.limits.torque = problem.limits.torque.cwiseMin(strength);
  problem.effort_weights = problem.limits.torque.cwiseAbs2().cwiseInverse();
  return problem;
}

MatrixXd straight_guess(const Problem& problem) {
  MatrixXd ends(problem.q_start.size(), 2);
  ends << problem.q_start, problem.q_goal;
  return guess_along(ends, problem.intervals);
}

std::vector<model::Model> robots() {
  const auto folder = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data" / "robots";
  description::RobotOptions panda;
  panda.tip = "panda_grasptarget";
  std::vector<model::Model> out;
  out.emplace_back(description::read_robot(folder / "planar4.json", {}));
  out.emplace_back(description::read_robot(folder / "arm7.urdf", {}));
  out.emplace_back(description::read_robot(folder / "third_party" / "panda.urdf", panda));
  return out;
}

}  // namespace

TEST_CASE("discrete mechanics beside trapezoidal collocation at equal knots",
          "[!benchmark][optimal]") {
  fmt::print("{:<12} {:<7} {:>4} {:<30} {:>13} {:>10} {:>11} {:>11} {:>11} {:>6} {:>9}\n", "robot",
             "least", "N", "method", "cost", "time, s", "error, rad", "held", "along", "iter.",
             "ms");
  for (const model::Model& model : robots())
    for (const auto objective : {Objective::effort, Objective::time})
      for (const int intervals : {10, 20, 50, 100, 200}) {
        const Problem problem = problem_of(model, objective, intervals);
        const MatrixXd guess = straight_guess(problem);
        print(model.robot().name.c_str(), problem, "discrete mechanics, banded",
              discrete_mechanics(problem, guess, &solve));
#ifdef HAMELIN_HAS_IPOPT
        print(model.robot().name.c_str(), problem, "discrete mechanics, IPOPT",
              discrete_mechanics(problem, guess, &solve_by_ipopt));
        print(model.robot().name.c_str(), problem, "trapezoidal, IPOPT",
              trapezoidal(problem, guess));
#endif
      }
}

TEST_CASE("least times beside those with many knots", "[!benchmark][optimal]") {
  fmt::print("{:<12} {:>5} {:>10} {:>12}\n", "robot", "N", "time, s", "above finest");
  for (const model::Model& model : robots()) {
    const auto least_time = [&](int intervals) {
      const Problem problem = problem_of(model, Objective::time, intervals);
      return solve(problem, straight_guess(problem)).step_s * intervals;
    };
    constexpr int finest = 800;
    const double reference = least_time(finest);
    for (const int intervals : {10, 20, 50, 100, 200})
      fmt::print("{:<12} {:>5} {:>10.6f} {:>10.3f} %\n", model.robot().name, intervals,
                 least_time(intervals), 100.0 * (least_time(intervals) / reference - 1.0));
    fmt::print("{:<12} {:>5} {:>10.6f}\n", model.robot().name, finest, reference);
  }
}

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <filesystem>

#include "../src/ipopt_solver.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/integration/integrator.hpp"
#include "hamelin/optimal/optimize.hpp"
#include "trapezoidal.hpp"

using namespace hamelin;
using namespace hamelin::optimal;

namespace {

using Eigen::Index;

// The largest error of a joint at the end if torques that are linear between the knots move the
// arm: gauss at 1e-12, with 400 parts of an interval in each of which the torque is its mean.
// With `held`, each torque is held from half a step before its knot to half a step after it.
double executed_error(const Problem& problem, const MatrixXd& torque, double h, bool held) {
  const auto plant = integration::make_integrator("gauss:8", *problem.model);
  auto state = plant->start(problem.q_start, problem.v_start);
  const int parts = held ? 10 : 100;
  integration::Channels channels;
  for (Index k = 0; k + 1 < torque.cols(); ++k)
    for (int i = 0; i < parts; ++i) {
      const double at = (i + 0.5) / parts, s = !held ? at : at < 0.5 ? 0.0 : 1.0;
      channels.held_torque = (1.0 - s) * torque.col(k) + s * torque.col(k + 1);
      if (!plant->step(state, channels, h / parts).converged) return 1e9;
    }
  return (state.q - problem.q_goal).lpNorm<Eigen::Infinity>();
}

// The middle of the ranges of the joints, 0 for joints without limits.
VectorXd middle_of(const model::Model& model) {
  const Limits limits = Limits::of(model);
  VectorXd out = VectorXd::Zero(model.dof());
  for (Index j = 0; j < out.size(); ++j)
    if (std::isfinite(limits.position_min[j]) && std::isfinite(limits.position_max[j]))
      out[j] = 0.5 * (limits.position_min[j] + limits.position_max[j]);
  return out;
}

// The same with the torques along the motion, at 20 points per interval and linear between them.
double motion_error(const Problem& problem, const Solution& found) {
  const TimedMotion motion{found.step_s, found.control};
  constexpr Index parts = 20;
  dynamics::Workspace ws(*problem.model);
  MatrixXd torque(problem.q_start.size(), parts * problem.intervals + 1);
  VectorXd at(problem.q_start.size());
  for (Index i = 0; i < torque.cols(); ++i) {
    torque_at(*problem.model, ws, motion, found.step_s * static_cast<double>(i) / parts, at);
    torque.col(i) = at;
  }
  return executed_error(problem, torque, found.step_s / parts, false);
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

Row discrete_mechanics(const Problem& problem, const MatrixXd& guess, Solver solver) {
  SolveOptions options;
  options.solver = solver;
  Solution found;
  Row row;
  row.milliseconds = milliseconds_of([&] { found = solve(problem, guess, options); });
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

}  // namespace

TEST_CASE("discrete mechanics beside trapezoidal collocation at equal knots",
          "[!benchmark][optimal]") {
  const auto robots = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data" / "robots";
  fmt::print("{:<12} {:<7} {:>4} {:<30} {:>13} {:>10} {:>11} {:>11} {:>11} {:>6} {:>9}\n", "robot",
             "least", "N", "method", "cost", "time, s", "error, rad", "held", "along", "iter.",
             "ms");
  description::RobotOptions robot_options;
  robot_options.tip = "panda_grasptarget";
  for (const char* name : {"planar4.json", "arm7.urdf", "third_party/panda.urdf"}) {
    const model::Model model(
        description::read_robot(robots / name, std::string(name).find("panda") != std::string::npos
                                                   ? robot_options
                                                   : description::RobotOptions{}));
    const Index n = model.dof();
    for (const auto objective : {Objective::effort, Objective::time})
      for (const int intervals : {10, 20, 50, 100}) {
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
        MatrixXd ends(n, 2);
        ends << problem.q_start, problem.q_goal;
        const MatrixXd guess = guess_along(ends, intervals);
        print(model.robot().name.c_str(), problem, "discrete mechanics, banded",
              discrete_mechanics(problem, guess, Solver::banded));
#ifdef HAMELIN_HAS_IPOPT
        print(model.robot().name.c_str(), problem, "discrete mechanics, IPOPT",
              discrete_mechanics(problem, guess, Solver::ipopt));
        print(model.robot().name.c_str(), problem, "trapezoidal, IPOPT",
              trapezoidal(problem, guess));
#endif
      }
  }
}

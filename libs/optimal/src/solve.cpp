#include "hamelin/optimal/solve.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "hamelin/core/error.hpp"
#include "interior_point.hpp"
#include "refuse.hpp"
#include "transcription.hpp"

namespace hamelin::optimal {

namespace {

void check_guess(const MatrixXd& guess, const Problem& problem) {
  const Eigen::Index n = problem.model->dof(), knots = problem.intervals + 1;
  if (guess.rows() != n || guess.cols() != knots)
    refuse(fmt::format("guess: {} × {} numbers given, expected {} × {} (joints × knots)",
                       guess.rows(), guess.cols(), n, knots));
  if (!guess.allFinite()) refuse("guess: a number is not finite, expected finite numbers");
}

void check_options(const SolveOptions& options) {
  if (!(options.tolerance > 0.0 && options.tolerance < 1.0))
    refuse(fmt::format("a tolerance of {} given, expected a number between 0 and 1",
                       options.tolerance));
  if (!(options.cost_tolerance >= 0.0 && options.cost_tolerance < 1.0))
    refuse(fmt::format("a tolerance of the cost of {} given, expected a number from 0 to 1",
                       options.cost_tolerance));
  if (!(options.violation_max >= 0.0 && options.violation_max < 1.0))
    refuse(fmt::format("a violation of {} that counts as none given, expected a number from 0 to 1",
                       options.violation_max));
  if (options.iterations_max < 0)
    refuse(fmt::format("{} iterations given, expected 0 or more", options.iterations_max));
}

// Less violation, or the same and less cost; violations within the tolerance are none.
bool better(double violation, double cost, double than_violation, double than_cost,
            double tolerance) {
  const double a = std::max(violation, tolerance), b = std::max(than_violation, tolerance);
  return a < b || (a == b && cost < than_cost);
}

// From the same guess with another μ or other slacks if a minimum of the violation was found that
// is not zero. The program is at the best of the minima afterwards. Among obstacles a large μ would
// centre the motion between kinks of thousands of distances.
Solution solve_banded(Transcription& program, const VectorXd& guess, const SolveOptions& options,
                      bool obstacles) {
  Solution best;
  VectorXd x = guess;
  double cost = infinity;
  int iterations = 0;
  using Start = InteriorPoint::Start;
  const std::array<Start, 4> starts{
      options.near_solution ? Start{1e-4, 0.01} : Start{obstacles ? 0.01 : 0.1, 1.0},
      {0.03, 0.01},
      {0.1, 0.01},
      {0.1, obstacles ? 1.0 : 0.1}};
  for (const Start& start : starts) {
    InteriorPoint solver(program, options, start);
    Solution found = solver.solve(guess);
    iterations += found.iterations;
    found.violation = program.violation();
    if (&start == &starts.front() ||
        better(found.violation, program.cost(), best.violation, cost, options.no_violation())) {
      best = std::move(found);
      x = solver.x();
      cost = program.cost();
    }
    if (best.violation <= options.no_violation() || (options.stop && options.stop())) break;
  }
  (void)program.evaluate(x);
  best.iterations = iterations;
  return best;
}

}  // namespace

void complete(Solution& found, const Transcription& program, double no_violation) {
  found.violation = program.violation(&found.violated);
  if (found.violation <= no_violation) {
    found.violated.clear();
  } else if (found.converged) {
    found.converged = false;
    found.cause = "bounds are violated by more than the tolerance";
  }
  found.cost = program.cost();
  found.control = program.points().q;
  found.torque = program.torques();
  found.step_s = program.points().h;
}

Solution solve(const Problem& problem, const MatrixXd& guess, const SolveOptions& options) {
  check(problem);
  check_guess(guess, problem);
  check_options(options);
  Transcription program(problem);
  const VectorXd x = program.variables_of(guess);
  Solution out = solve_banded(program, x, options, problem.clearance != nullptr);
  complete(out, program, options.no_violation());
  return out;
}

MatrixXd guess_along(const MatrixXd& way_points, int intervals) {
  if (way_points.rows() < 1 || way_points.cols() < 2)
    refuse(
        fmt::format("way-points: {} × {} numbers given, expected one column for each of 2 or "
                    "more points",
                    way_points.rows(), way_points.cols()));
  if (!way_points.allFinite())
    refuse("way-points: a number is not finite, expected finite numbers");
  if (intervals < 1) refuse(fmt::format("{} intervals given, expected at least 1", intervals));
  const Eigen::Index count = way_points.cols();
  VectorXd lengths = VectorXd::Zero(count);
  for (Eigen::Index i = 1; i < count; ++i)
    lengths[i] = lengths[i - 1] + (way_points.col(i) - way_points.col(i - 1)).norm();
  MatrixXd out(way_points.rows(), intervals + 1);
  Eigen::Index next = 1;
  for (int k = 0; k <= intervals; ++k) {
    const double s = static_cast<double>(k) / intervals,
                 at = lengths[count - 1] * s * s * s * (10.0 + s * (6.0 * s - 15.0));
    while (next + 1 < count && lengths[next] < at) ++next;
    const double length = lengths[next] - lengths[next - 1],
                 t = length > 0.0 ? (at - lengths[next - 1]) / length : 0.0;
    out.col(k) = (1.0 - t) * way_points.col(next - 1) + t * way_points.col(next);
  }
  return out;
}

}  // namespace hamelin::optimal

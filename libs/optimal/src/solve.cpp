#include "hamelin/optimal/solve.hpp"

#include <array>
#include <cmath>

#include "hamelin/core/error.hpp"
#include "interior_point.hpp"
#include "transcription.hpp"
#ifdef HAMELIN_HAS_IPOPT
#include "ipopt_solver.hpp"
#include "transcription_program.hpp"
#endif

namespace hamelin::optimal {

namespace {

#ifdef HAMELIN_HAS_IPOPT
Solution solve_with_ipopt(Transcription& program, const VectorXd& guess,
                          const SolveOptions& options) {
  TranscriptionProgram adapted(program);
  const IpoptResult found = solve_by_ipopt(adapted, guess, options);
  Solution out;
  out.converged = found.converged;
  out.cause = found.cause;
  out.iterations = found.iterations;
  out.stationarity = found.stationarity;
  return out;
}
#else
Solution solve_with_ipopt(Transcription&, const VectorXd&, const SolveOptions&) {
  throw Error(ErrorCode::usage,
              "solver ipopt: this build has no IPOPT, expected solver banded, or a build with "
              "coinor-libipopt-dev installed");
}
#endif

// From the same guess with other slacks if a minimum of the violation was found that is not zero.
// Among obstacles a large μ would centre the motion between kinks of thousands of distances.
Solution solve_banded(Transcription& program, const VectorXd& guess, const SolveOptions& options,
                      bool obstacles) {
  Solution out;
  int iterations = 0;
  using Start = InteriorPoint::Start;
  const std::array<Start, 4> starts{
      options.near_solution ? Start{1e-4, 0.01} : Start{obstacles ? 0.01 : 0.1, 1.0},
      {0.1, 1.0, true},
      {0.1, 0.01, true},
      {0.1, 0.1, true}};
  for (const Start& start : starts) {
    out = InteriorPoint(program, options, start).solve(guess);
    iterations += out.iterations;
    if (program.violation() <= options.tolerance) break;
  }
  out.iterations = iterations;
  return out;
}

}  // namespace

bool has_ipopt() noexcept {
#ifdef HAMELIN_HAS_IPOPT
  return true;
#else
  return false;
#endif
}

Solution solve(const Problem& problem, const MatrixXd& guess, const SolveOptions& options) {
  check(problem);
  Transcription program(problem);
  const VectorXd x = program.variables_of(guess);
  Solution out = options.solver == Solver::ipopt
                     ? solve_with_ipopt(program, x, options)
                     : solve_banded(program, x, options, problem.clearance != nullptr);
  std::string what;
  out.violation = program.violation(&what);
  if (!out.converged && out.violation > options.tolerance) out.cause += "; violated: " + what;
  out.cost = program.cost();
  out.control = program.points().q;
  out.torque = program.torques();
  out.step_s = program.points().h;
  return out;
}

MatrixXd guess_along(const MatrixXd& way_points, int intervals) {
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

#include "hamelin/optimal/solve.hpp"

#include <cmath>

#include "interior_point.hpp"
#include "transcription.hpp"

namespace hamelin::optimal {

Solution solve(const Problem& problem, const MatrixXd& guess, const SolveOptions& options) {
  check(problem);
  Transcription program(problem);
  InteriorPoint method(program, options);
  Solution out = method.solve(program.variables_of(guess));
  std::string what;
  out.violation = program.violation(&what);
  if (!out.converged && out.violation > options.tolerance) out.cause += "; violated: " + what;
  out.cost = program.cost();
  out.q = program.knots().q;
  out.torque = program.torques();
  out.step_s = program.knots().h;
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

#include "hamelin/optimal/optimize.hpp"

#include <algorithm>
#include <cmath>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/optimal/world_clearance.hpp"

namespace hamelin::optimal {

using Eigen::Index;

namespace {

// Of the knots, and of points between them.
double largest_torque_share(const VectorXd& limit, const Problem& problem,
                            const TimedMotion& motion) {
  if (limit.size() == 0) return 0.0;
  dynamics::Workspace ws(*problem.model);
  VectorXd torque(limit.size());
  double most = 0.0;
  constexpr Index per_interval = 8;
  for (Index i = 0; i <= per_interval * motion.intervals(); ++i) {
    torque_at(*problem.model, ws, motion,
              motion.step_s * static_cast<double>(i) / static_cast<double>(per_interval), torque);
    most = std::max(most, torque.cwiseQuotient(limit).lpNorm<Eigen::Infinity>());
  }
  return most;
}

}  // namespace

Optimized optimize(Problem problem, const MatrixXd& way_points, control::WorldView& view,
                   SolveOptions options) {
  WorldClearance clearance(*problem.model, view);
  if (clearance.rows() > 0) problem.clearance = &clearance;
  MatrixXd guess = guess_along(way_points, problem.intervals);
  const VectorXd limits = problem.limits.torque;
  constexpr int lowered_max = 6;
  int lowered = 0;
  Optimized out;
  for (;;) {
    out.solution = solve(problem, guess, options);
    out.iterations += out.solution.iterations;
    out.motion = {out.solution.step_s, out.solution.control};
    out.proof = prove(out.motion, view);
    out.clearance_points = problem.clearance_points;
    out.torque_share = largest_torque_share(limits, problem, out.motion);
    const bool clear = out.proof.certified || problem.clearance == nullptr ||
                       2 * problem.clearance_points > clearance_points_max,
               strong = out.torque_share <= 1.0 || lowered == lowered_max;
    if (out.solution.violation > options.tolerance || (clear && strong)) break;
    if (!clear) problem.clearance_points *= 2;
    if (!strong) {
      problem.limits.torque *= 1.0 - 1.2 * (out.torque_share - 1.0);
      ++lowered;
    }
    options.near_solution = true;
    guess = out.solution.control.middleCols(1, problem.intervals + 1);
    problem.duration_s = out.motion.duration_s();
  }
  return out;
}

}  // namespace hamelin::optimal

#include "hamelin/optimal/optimize.hpp"

#include <algorithm>
#include <cmath>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/optimal/world_clearance.hpp"

namespace hamelin::optimal {

using Eigen::Index;

namespace {

// Of the knots, and of points between them.
double largest_torque_share(const Problem& problem, const TimedMotion& motion) {
  const VectorXd& limit = problem.limits.torque;
  if (limit.size() == 0) return 0.0;
  dynamics::Workspace ws(*problem.model);
  VectorXd torque(limit.size());
  double most = 0.0;
  constexpr Index per_interval = 8;
  for (Index i = 0; i <= per_interval * (motion.knots() - 1); ++i) {
    torque_at(*problem.model, ws, motion,
              motion.step_s * static_cast<double>(i) / static_cast<double>(per_interval), torque);
    most = std::max(most, torque.cwiseQuotient(limit).lpNorm<Eigen::Infinity>());
  }
  return most;
}

}  // namespace

void torque_at(const model::Model& model, dynamics::Workspace& ws, const TimedMotion& motion,
               double time_s, VectorXd& torque) {
  VectorXd q, v, a;
  motion.at(time_s, q, v, a);
  dynamics::inverse_dynamics(model, ws, q, v, a, torque);
}

Optimized optimize(Problem problem, const MatrixXd& way_points, control::WorldView& view,
                   const SolveOptions& options) {
  WorldClearance clearance(*problem.model, view);
  if (clearance.rows() > 0) problem.clearance = &clearance;
  MatrixXd guess = guess_along(way_points, problem.intervals);
  Optimized out;
  for (;;) {
    out.solution = solve(problem, guess, options);
    out.motion = motion_of(problem, out.solution);
    out.proof = prove(out.motion, view);
    out.clearance_points = problem.clearance_points;
    if (out.proof.certified || problem.clearance == nullptr ||
        2 * problem.clearance_points > clearance_points_max)
      break;
    problem.clearance_points *= 2;
    if (out.solution.violation > options.tolerance) continue;
    guess = out.solution.q;
    problem.duration_s = out.motion.duration_s();
  }
  out.torque_share = largest_torque_share(problem, out.motion);
  return out;
}

}  // namespace hamelin::optimal

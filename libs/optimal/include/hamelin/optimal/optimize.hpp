#pragma once
#include "hamelin/optimal/timed_motion.hpp"

namespace hamelin::optimal {

/// An optimised motion, and what is known of it.
struct Optimized {
  /// `violation` and `violated` are of what was asked for, also between the knots: they include the
  /// torques along the motion, and what the proved clearance falls short of the margin by. The rest
  /// is of the last problem that was solved, which may have tighter bounds.
  Solution solution;
  TimedMotion motion;        ///< may have more intervals than the problem
  MotionProof proof;         ///< of the margin, at all times
  int clearance_points = 0;  ///< per interval, that the proof needed
  int iterations = 0;        ///< of all solutions together
  /// Largest torque along the motion as a share of its limit; 0 without limits. Measured at 16
  /// places per interval.
  double torque_share = infinity;
};

/// Solves a problem and examines its motion at all times: whether the margin is proved, and whether
/// the torques between the knots keep their limits. If not, it is solved again, docs/theory.md
/// (18.19): with more points of clearance per interval, up to `clearance_points_max`, and a larger
/// reserve of the margin; with more intervals where torques between the knots are far above their
/// limits, and with lower torques at the knots. Of these motions the one that violates least is
/// returned, with its violation.
/// @param way_points of a path from start to goal, dof × (2 or more), along which the guess goes
/// @throws Error like solve() and guess_along()
[[nodiscard]] Optimized optimize(const Problem& problem, const MatrixXd& way_points,
                                 control::WorldView& view, const SolveOptions& options = {});

inline constexpr int clearance_points_max = 16;

}  // namespace hamelin::optimal

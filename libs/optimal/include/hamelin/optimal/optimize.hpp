#pragma once
#include "hamelin/optimal/timed_motion.hpp"

namespace hamelin::optimal {

/// An optimised motion, and what is known of it.
struct Optimized {
  Solution solution;
  TimedMotion motion;
  MotionProof proof;         ///< of the motion between the knots
  int clearance_points = 0;  ///< per interval, that the proof needed
  int iterations = 0;        ///< of all solutions together
  /// Largest torque along the motion as a share of its limit; 0 without limits.
  double torque_share = 0.0;
};

/// Solves a problem and proves the motion clear at all times. If that fails, it is solved again
/// with twice as many points of clearance per interval, up to `clearance_points_max`; if the
/// torques along the motion exceed limits, with limits that are so much lower.
/// @param way_points of a path from start to goal, dof × (2 or more), along which the guess goes
/// @throws Error like solve()
[[nodiscard]] Optimized optimize(Problem problem, const MatrixXd& way_points,
                                 control::WorldView& view, SolveOptions options = {});

inline constexpr int clearance_points_max = 16;

}  // namespace hamelin::optimal

#pragma once
#include "hamelin/optimal/timed_motion.hpp"

namespace hamelin::optimal {

/// An optimised motion, and what is known of it.
struct Optimized {
  Solution solution;
  TimedMotion motion;
  MotionProof proof;         ///< of the motion between the knots
  int clearance_points = 0;  ///< per interval, that the proof needed
  /// Largest torque along the motion as a share of its limit; 0 without limits.
  double torque_share = 0.0;
};

/// Solves a problem and proves the motion clear between its knots. If that fails, it is solved
/// again with twice as many points of clearance per interval, up to `clearance_points_max`.
/// @param way_points of a path from start to goal, dof × (2 or more), along which the guess goes
/// @throws Error like solve()
[[nodiscard]] Optimized optimize(Problem problem, const MatrixXd& way_points,
                                 control::WorldView& view, const SolveOptions& options = {});

inline constexpr int clearance_points_max = 16;

/// Torques along a motion at a time: those that move the arm along the polynomials exactly.
void torque_at(const model::Model& model, dynamics::Workspace& ws, const TimedMotion& motion,
               double time_s, VectorXd& torque);

}  // namespace hamelin::optimal

#pragma once
#include <array>

#include "hamelin/control/world_view.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/optimal/solve.hpp"

namespace hamelin::optimal {

/// A motion over time: a uniform cubic B-spline, docs/theory.md (18.2). Its velocities,
/// accelerations and jerks are means of the difference quotients of its control points, so that it
/// keeps their limits at all times.
struct TimedMotion {
  double step_s = 0.0;
  MatrixXd control;  ///< dof × (N + 3), one point beyond each end

  [[nodiscard]] Eigen::Index intervals() const noexcept { return control.cols() - 3; }
  [[nodiscard]] double duration_s() const noexcept {
    return step_s * static_cast<double>(intervals());
  }
  /// Whether it is one: a positive step, at least one interval, and finite numbers.
  [[nodiscard]] bool well_formed() const;
  /// Position, velocity and acceleration at a time, which is clamped to the motion.
  /// @throws Error invalid if the step is not positive, there is no interval, or the time is no
  ///         number
  void at(double time_s, VectorXd& q, VectorXd& v, VectorXd& a) const;
};

/// Weights of the control points k − 1 to k + 2 at the place s, 0 to 1, between the knots k and
/// k + 1.
[[nodiscard]] std::array<double, 4> spline_weights(double s) noexcept;

/// Torques that move the arm along a motion.
/// @throws Error invalid as TimedMotion::at()
void torque_at(const model::Model& model, dynamics::Workspace& ws, const TimedMotion& motion,
               double time_s, VectorXd& torque);

/// What is proved of a motion in a world, see control::Certificate.
struct MotionProof {
  /// Whether all distances are proved to be positive and at least the margin asked for, at all
  /// times.
  bool certified = false;
  /// Lower bound of all distances; infinite if there is nothing to touch, −infinity if nothing is
  /// proved.
  double margin_m = -infinity;
  double first_open_s = 0.0;  ///< where the first piece begins that is not proved
  double piece_s = 0.0;       ///< length of the longest pieces
};

struct ProofOptions {
  double margin_m = 0.0;  ///< least clearance, less than the influence of the view
  double begin_s = 0.0;   ///< time at which the motion begins, for obstacles that move
  double piece_s = 4e-3;  ///< length of a piece, positive
};

/// Proves that the arm keeps the margin along a motion, in pieces of at most `piece_s` that are
/// bisected where that is not enough, docs/theory.md (18.18). A motion that is not well_formed() is
/// not certified.
/// @throws Error invalid for options out of their range
[[nodiscard]] MotionProof prove(const TimedMotion& motion, control::WorldView& view,
                                const ProofOptions& options = {});

}  // namespace hamelin::optimal

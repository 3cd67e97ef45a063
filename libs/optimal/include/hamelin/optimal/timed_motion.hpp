#pragma once
#include <array>

#include "hamelin/control/world_view.hpp"
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
  /// Position, velocity and acceleration at a time, which is clamped to the motion.
  void at(double time_s, VectorXd& q, VectorXd& v, VectorXd& a) const;
};

/// Weights of the control points k − 1 to k + 2 at the place s, 0 to 1, between the knots k and
/// k + 1.
[[nodiscard]] std::array<double, 4> spline_weights(double s) noexcept;

/// Torques that move the arm along a motion.
void torque_at(const model::Model& model, dynamics::Workspace& ws, const TimedMotion& motion,
               double time_s, VectorXd& torque);

/// What is proved of a motion in a world, see control::Certificate.
struct MotionProof {
  bool certified = true;
  double margin_m = 0.0;      ///< lower bound of all distances
  double first_open_s = 0.0;  ///< where the first piece begins that is not proved
  double piece_s = 0.0;       ///< length of the pieces
};

/// Proves that the arm stays clear along a motion, in pieces of at most `piece_s`.
[[nodiscard]] MotionProof prove(const TimedMotion& motion, control::WorldView& view,
                                double piece_s = 1e-3);

}  // namespace hamelin::optimal

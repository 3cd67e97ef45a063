#pragma once
#include "hamelin/control/world_view.hpp"
#include "hamelin/optimal/solve.hpp"

namespace hamelin::optimal {

/// A motion over time: knots at equal steps, and between them polynomials of degree five through
/// positions, velocities and accelerations, docs/theory.md (18.12).
struct TimedMotion {
  double step_s = 0.0;
  MatrixXd q, v, a, torque;  ///< dof × (N + 1)

  [[nodiscard]] Eigen::Index knots() const noexcept { return q.cols(); }
  [[nodiscard]] double duration_s() const noexcept {
    return step_s * static_cast<double>(knots() - 1);
  }
  /// Position, velocity and acceleration at a time, which is clamped to the motion.
  void at(double time_s, VectorXd& q_out, VectorXd& v_out, VectorXd& a_out) const;
};

/// The motion of a solution: velocities by the momenta at its knots, accelerations by its torques.
[[nodiscard]] TimedMotion motion_of(const Problem& problem, const Solution& solution);

/// What is proved of a motion in a world, see control::Certificate.
struct MotionProof {
  bool certified = true;
  double margin_m = 0.0;      ///< lower bound of all distances
  double first_open_s = 0.0;  ///< where the first piece begins that is not proved
  double sample_s = 0.0;      ///< length of the pieces
};

/// Proves that the arm stays clear along a motion, in pieces of at most `sample_s`.
[[nodiscard]] MotionProof prove(const TimedMotion& motion, control::WorldView& view,
                                double sample_s = 1e-3);

}  // namespace hamelin::optimal

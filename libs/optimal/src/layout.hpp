#pragma once
#include <vector>

#include "hamelin/optimal/problem.hpp"

namespace hamelin::optimal {

using Eigen::Index;

/// How the variables x = (q_2, …, q_{N−2}, h/h_ref) are arranged; the last only if the time is
/// free. The two outermost knots at each end follow from the states there: q_0 and q_1 = q_0 + h
/// v_start, q_N and q_{N−1} = q_N − h v_goal, docs/theory.md (18.1).
struct Layout {
  Index n, intervals;
  bool free_time;
  double h_ref;  ///< [s]
  VectorXd v_start, v_goal;

  [[nodiscard]] Index blocks() const noexcept { return intervals - 3; }
  [[nodiscard]] Index variables() const noexcept { return blocks() * n + (free_time ? 1 : 0); }
  [[nodiscard]] bool varies(Index knot) const noexcept { return knot > 1 && knot < intervals - 1; }
  /// The block of a knot that varies.
  [[nodiscard]] static Index block(Index knot) noexcept { return knot - 2; }
  [[nodiscard]] Index variable(Index knot, Index joint) const noexcept {
    return block(knot) * n + joint;
  }
  [[nodiscard]] Index step_variable() const noexcept { return blocks() * n; }
  /// ∂q_knot/∂(h/h_ref) of a knot that does not vary.
  [[nodiscard]] double rate(Index knot, Index joint) const {
    return knot == 1               ? h_ref * v_start[joint]
           : knot == intervals - 1 ? -h_ref * v_goal[joint]
                                   : 0.0;
  }
  [[nodiscard]] bool moves_with_step(Index knot) const {
    return free_time &&
           ((knot == 1 && !v_start.isZero(0.0)) || (knot == intervals - 1 && !v_goal.isZero(0.0)));
  }
  /// Calls f(variable, derivative) for a derivative by a joint at a knot.
  template <class F>
  void chain(Index knot, Index joint, double derivative, F&& f) const {
    if (varies(knot))
      f(variable(knot, joint), derivative);
    else if (moves_with_step(knot))
      f(step_variable(), derivative * rate(knot, joint));
  }
};

/// All knots, dof × (N + 1), and the step between them.
struct Knots {
  MatrixXd q;
  double h = 0.0;
};

/// Bounds of rows, appended one by one.
struct Bounds {
  std::vector<double> lower, upper;
  [[nodiscard]] Index size() const noexcept { return static_cast<Index>(lower.size()); }
};

}  // namespace hamelin::optimal

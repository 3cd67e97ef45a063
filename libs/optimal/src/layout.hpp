#pragma once
#include <vector>

#include "hamelin/optimal/problem.hpp"

namespace hamelin::optimal {

using Eigen::Index;

/// How the variables x = (q_1, …, q_{N−1}, h/h_ref) are arranged; the last only if the time is
/// free. The first and the last knot are fixed.
struct Layout {
  Index n, intervals;
  bool free_time;
  double h_ref;  ///< [s]

  [[nodiscard]] Index blocks() const noexcept { return intervals - 1; }
  [[nodiscard]] Index variables() const noexcept { return blocks() * n + (free_time ? 1 : 0); }
  [[nodiscard]] bool varies(Index knot) const noexcept { return knot > 0 && knot < intervals; }
  /// The variable of a joint at a knot that varies.
  [[nodiscard]] Index variable(Index knot, Index joint) const noexcept {
    return (knot - 1) * n + joint;
  }
  [[nodiscard]] Index step_variable() const noexcept { return blocks() * n; }
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

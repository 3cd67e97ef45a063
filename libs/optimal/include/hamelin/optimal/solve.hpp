#pragma once
#include <algorithm>
#include <functional>
#include <string>

#include "hamelin/core/numbers.hpp"
#include "hamelin/optimal/problem.hpp"

namespace hamelin::optimal {

struct SolveOptions {
  int iterations_max = 300;  ///< of one start
  /// On stationarity, violation of bounds as shares of them, and complementarity; positive.
  double tolerance = 1e-8;
  /// The solver also ends where about this share of the cost may be left to gain, and bounds
  /// are violated by no more than violation_max; zero: never.
  double cost_tolerance = 0.0;
  /// Violation that counts as none where it is more than the tolerance, as a share of the bounds,
  /// or in decimetres of clearance.
  double violation_max = 0.0;
  [[nodiscard]] double no_violation() const noexcept { return std::max(tolerance, violation_max); }
  /// Whether the guess is the solution of a similar problem.
  bool near_solution = false;
  /// Asked before each iteration; true ends the solution. Optional.
  std::function<bool()> stop;
};

/// What a solver found.
struct Solution {
  bool converged = false;
  std::string cause;     ///< why it did not converge: one line, or empty
  std::string violated;  ///< what is violated most: one line, or empty
  MatrixXd control;      ///< control points, dof × (N + 3), see TimedMotion
  MatrixXd torque;       ///< at the knots, dof × (N + 1), by the discrete equations
  double step_s = 0.0;   ///< between two knots
  double cost = 0.0;     ///< ∫ τᵀRτ dt, or the time plus its weight of the effort
  /// The largest violation, as a share of the bound, or in decimetres of clearance; infinite if
  /// there is no motion.
  double violation = infinity;
  int iterations = 0;
  double stationarity = infinity;
};

/// Solves the problem on the discrete equations of motion, docs/theory.md (18.1)–(18.8), by an
/// interior-point method on the banded equations, (18.9)–(18.12). Of its starts, the one that
/// violates least is returned, and of these the cheapest.
/// @param guess knots, dof × (N + 1), finite, of which the inner ones are used
/// @throws Error invalid for a Problem that check() refuses, a guess of another size and options
///         out of their range
[[nodiscard]] Solution solve(const Problem& problem, const MatrixXd& guess,
                             const SolveOptions& options = {});

/// A guess at rest at both ends: along way-points at equal shares of length, with the smooth
/// profile 10 s³ − 15 s⁴ + 6 s⁵ of the arc length.
/// @param way_points dof × (2 or more), finite, from start to goal
/// @param intervals at least 1
/// @throws Error invalid for way-points and intervals that are not so
[[nodiscard]] MatrixXd guess_along(const MatrixXd& way_points, int intervals);

}  // namespace hamelin::optimal

#pragma once
#include <string>

#include "banded.hpp"
#include "clearance_rows.hpp"
#include "hamelin/optimal/solve.hpp"
#include "quotient_rows.hpp"
#include "step_row.hpp"
#include "torques.hpp"

namespace hamelin::optimal {

/// A Problem as a nonlinear program: minimise f(x) with lower ≤ c(x) ≤ upper. The discrete
/// equations of motion hold for every x, as torques follow from them: docs/theory.md (18.4). Rows
/// touch few successive knots, so that the Hessian is banded.
class Transcription {
 public:
  /// @param problem is kept by reference
  explicit Transcription(const Problem& problem);

  [[nodiscard]] const Layout& layout() const noexcept { return layout_; }
  [[nodiscard]] Index variables() const noexcept { return layout_.variables(); }
  [[nodiscard]] Index rows() const noexcept { return lower_.size(); }
  /// The first rows, whose derivatives never vanish for all x; the rest are clearances, which are
  /// constant where nothing is near.
  [[nodiscard]] Index steady_rows() const noexcept { return rows() - places_.rows(); }
  [[nodiscard]] const VectorXd& lower() const noexcept { return lower_; }
  [[nodiscard]] const VectorXd& upper() const noexcept { return upper_; }
  /// A matrix of the shape of the Hessian.
  [[nodiscard]] BandedMatrix hessian_matrix() const;

  /// x for a guess of the inner control points by knots, dof × (N + 1), in the time of the problem.
  [[nodiscard]] VectorXd variables_of(const MatrixXd& knots) const;
  /// Cost, rows and their first derivatives at x. @return false if a number is not finite
  bool evaluate(const VectorXd& x);

  // at the last x
  [[nodiscard]] double cost() const noexcept { return cost_; }
  [[nodiscard]] const VectorXd& values() const noexcept { return values_; }
  void gradient(VectorXd& out) const;
  /// Calls f(row) for the rows behind the steady ones that are not constant there.
  template <class F>
  void for_each_near(F&& f) const {
    places_.for_each_near([&](Index r) { f(steady_rows() + r); });
  }
  /// Calls f(row, variable, derivative) for the entries of J; with `all` for the same ones in the
  /// same order at every x.
  template <bool all = false, class F>
  void for_each_entry(F&& f) const {
    quotients_.for_each_entry(f);
    const Index first_torque = quotients_.rows(), step_row = first_torque + torques_.rows(),
                first_place = step_row + step_.rows();
    torques_.for_each_entry([&](Index r, Index v, double d) { f(first_torque + r, v, d); });
    step_.for_each_entry([&](Index r, Index v, double d) { f(step_row + r, v, d); });
    places_.for_each_entry<all>([&](Index r, Index v, double d) { f(first_place + r, v, d); });
  }
  /// factor ∇²f + Σ y_i ∇²c_i + Jᵀ diag(weights) J, without the curvature of distances; without
  /// `curved` only the part that is never negative, as in the Gauss–Newton method.
  void hessian(double factor, const VectorXd& y, const VectorXd& weights, bool curved,
               BandedMatrix& out);
  [[nodiscard]] const Points& points() const noexcept { return points_; }
  [[nodiscard]] const MatrixXd& torques() const noexcept { return torques_.torques(); }
  /// The largest violation of a row, and what the row bounds; infinite if the last evaluate() found
  /// a number that is not finite, or there was none.
  [[nodiscard]] double violation(std::string* what = nullptr) const;

 private:
  void place_points(const VectorXd& x);
  /// The weight of the effort in the cost.
  [[nodiscard]] double effort_factor() const;
  [[nodiscard]] std::string describe(Index row) const;

  const Problem& problem_;
  Layout layout_;
  Bounds bounds_;  ///< filled by the members below in this order
  QuotientRows quotients_;
  Torques torques_;
  StepRow step_;
  ClearanceRows places_;
  VectorXd lower_, upper_;

  Points points_;
  bool finite_ = false;  ///< what the last evaluate() returned
  double cost_ = 0.0;
  VectorXd values_;
};

/// What is known of the point at which a solver left the program: violation, cost and motion.
/// @param no_violation what counts as none
void complete(Solution& found, const Transcription& program, double no_violation);

}  // namespace hamelin::optimal

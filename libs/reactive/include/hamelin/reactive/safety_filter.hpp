#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <vector>

namespace hamelin::reactive {

/// Finds the admissible velocity nearest to ũ in the norm of kinetic energy, docs/theory.md (10.9):
///   x = argmin ½ (x − ũ)ᵀ M (x − ũ)  subject to a_i·x ≥ b_i and boxes on x and the momentum M x,
/// by Hildreth's dual Gauss–Seidel method, docs/theory.md (10.14): each row in turn moves x along
/// M⁻¹ a_i until the row holds, and moves it back by at most as much. The dual function starts at
/// zero and never falls, so after any number of passes, docs/theory.md (10.15),
///   ½ xᵀMx ≤ ½ ũᵀMũ + Σ λ_i b_i.
/// The filter adds no kinetic energy if no b_i is positive. The energy that rows with b_i > 0 may
/// add, Σ λ_i b_i, is booked separately.
class SafetyFilter {
 public:
  SafetyFilter(int dof, int max_rows);

  /// Starts a new problem in the metric M with inverse W. Boxes are unbounded until set. M and W
  /// must outlive project().
  void begin(const Eigen::MatrixXd& M, const Eigen::MatrixXd& W);
  /// Adds the row a·x ≥ b. If a·x is below `floor` ≤ 0 after the passes, x is scaled towards zero
  /// until a·x equals `floor`: docs/theory.md (10.18). A positive floor is ignored.
  /// A row with softness κ > 0 may be violated, by ρ λ with its multiplier λ and ρ = κ aᵀW a:
  /// docs/theory.md (10.32). It has no floor.
  /// @return false if there are max_rows rows already
  bool add_row(const Eigen::VectorXd& a, double b, double floor, double softness = 0.0);
  /// Sets the bounds lower ≤ x ≤ upper.
  void set_box(const Eigen::VectorXd& lower, const Eigen::VectorXd& upper);
  /// Sets the bounds lower ≤ M x ≤ upper.
  void set_momentum_box(const Eigen::VectorXd& lower, const Eigen::VectorXd& upper);

  /// By how much a·x can surely be raised above a·from within the boxes, docs/theory.md (10.19): by
  /// the better of a step along M⁻¹ a and a step towards the corner of the box that is farthest
  /// along a. Never negative.
  [[nodiscard]] double braking_room(const Eigen::VectorXd& a, const Eigen::VectorXd& from);

  /// Bounds of each joint with their multipliers.
  struct Box {
    Eigen::VectorXd lower, upper, lambda_low, lambda_high;
    /// Σ λ b over the bounds of joint k with b > 0.
    [[nodiscard]] double recovery(Eigen::Index k) const {
      return std::max(0.0, lambda_low[k] > 0.0 ? lambda_low[k] * lower[k] : 0.0) +
             std::max(0.0, lambda_high[k] > 0.0 ? -lambda_high[k] * upper[k] : 0.0);
    }
  };

  struct Report {
    int passes = 0;
    double energy_before_J = 0.0, energy_after_J = 0.0;  ///< ½ ũᵀMũ, ½ xᵀMx
    double recovery_J = 0.0;                             ///< Σ λ_i b_i over rows with b_i > 0
    double scale = 1.0;                                  ///< factor applied to x for the floors
  };
  /// Projects x in place. If a hard row is below its floor after the passes, and there are soft
  /// rows, the result is projected again onto hard rows and boxes alone: docs/theory.md (10.33).
  /// @param max_passes at least 1
  Report project(Eigen::VectorXd& x, int max_passes);

  /// Multipliers after project(): of row i, of joint k's bounds, of joint k's momentum bounds. A
  /// positive multiplier holds x back.
  [[nodiscard]] double row_multiplier(int i) const {
    return rows_[static_cast<std::size_t>(i)].lambda;
  }
  [[nodiscard]] double box_multiplier(int k) const {
    return box_.lambda_low[k] + box_.lambda_high[k];
  }
  [[nodiscard]] double momentum_multiplier(int k) const {
    return momentum_box_.lambda_low[k] + momentum_box_.lambda_high[k];
  }
  [[nodiscard]] int row_count() const noexcept { return count_; }

 private:
  struct Row {
    double b = 0.0, floor = 0.0, weight = 0.0, lambda = 0.0;
    double rho = 0.0;  ///< of a soft row; zero: hard
  };
  enum class Rows { all, hard };
  void clear_multipliers();
  /// @return the number of passes
  int run_passes(Eigen::VectorXd& x, int max_passes, Rows which);
  /// Whether a hard row is below its floor.
  [[nodiscard]] bool floor_is_broken(const Eigen::VectorXd& x) const;
  /// One pass over rows, box or momentum box.
  /// @return the largest squared move of x in the metric [J]
  double pass_rows(Eigen::VectorXd& x, Rows which);
  double pass_box(Eigen::VectorXd& x);
  double pass_momentum_box(Eigen::VectorXd& x);
  /// Σ λ_i b_i over all rows and bounds with b_i > 0.
  [[nodiscard]] double recovery() const;

  const Eigen::MatrixXd* M_ = nullptr;
  const Eigen::MatrixXd* W_ = nullptr;
  Eigen::MatrixXd a_, Wa_;  ///< one column per row a_i
  std::vector<Row> rows_;
  int count_ = 0;
  bool has_soft_rows_ = false;
  bool has_momentum_box_ = false;
  Box box_, momentum_box_;
  Eigen::VectorXd Mx_, step_, Mfrom_;
};

}  // namespace hamelin::reactive

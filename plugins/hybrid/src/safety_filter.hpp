#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <vector>

namespace hamelin::hybrid {

/// The nearest admissible velocity in the metric of kinetic energy:
///   x = argmin ½ (x − ũ)ᵀ M (x − ũ)  subject to rows a_i · x ≥ b_i, a box on x, a box on the momentum M x,
/// by Hildreth's dual Gauss–Seidel: each row in turn moves x along M⁻¹ a_i until it holds, never giving back more than
/// it took. The dual starts at zero and only rises, so after any number of passes
///   ½ xᵀMx ≤ ½ ũᵀMũ + Σ λ_i b_i,
/// and where no right-hand side is positive the filter cannot add kinetic energy. What rows with b_i > 0 (that demand
/// motion) add is at most λ_i b_i, and is accounted for apart.
class SafetyFilter {
 public:
  SafetyFilter(int dof, int max_rows);

  /// A new problem in the metric M with inverse W. Boxes are open until set. M and W must outlive project().
  void begin(const Eigen::MatrixXd& M, const Eigen::MatrixXd& W);
  /// a · x ≥ b. `floor` ≤ 0 is what a · x must reach in any case: where the passes end short of it, x is scaled towards
  /// standing still. Rows past the room for them are not taken (false).
  bool add_row(const Eigen::VectorXd& a, double b, double floor);
  /// lower ≤ x ≤ upper, joint by joint.
  void set_box(const Eigen::VectorXd& lower, const Eigen::VectorXd& upper);
  /// lower ≤ M x ≤ upper.
  void set_momentum_box(const Eigen::VectorXd& lower, const Eigen::VectorXd& upper);

  /// How much a · x can surely be raised above a · from within the boxes: the better of a step along M⁻¹ a and one
  /// towards the box's far corner. Never below zero.
  [[nodiscard]] double room(const Eigen::VectorXd& a, const Eigen::VectorXd& from);

  /// Bounds joint by joint, each with its multiplier.
  struct Box {
    Eigen::VectorXd lower, upper, lambda_low, lambda_high;
    /// Σ λ b over joint k's bounds with b > 0.
    [[nodiscard]] double recovery(Eigen::Index k) const {
      return std::max(0.0, lambda_low[k] > 0.0 ? lambda_low[k] * lower[k] : 0.0) +
             std::max(0.0, lambda_high[k] > 0.0 ? -lambda_high[k] * upper[k] : 0.0);
    }
  };

  struct Report {
    int passes = 0;
    double energy_before_J = 0.0, energy_after_J = 0.0;  ///< ½ ũᵀMũ, ½ xᵀMx
    double recovery_J = 0.0;                             ///< Σ λ_i b_i over rows with b_i > 0
    double scale = 1.0;                                  ///< of the last step
  };
  /// Projects x in place. @param max_passes at least 1
  Report project(Eigen::VectorXd& x, int max_passes);

  /// What holds x back after project(): the multiplier of row i, of joint k's box, of joint k's momentum box.
  [[nodiscard]] double row_multiplier(int i) const { return rows_[static_cast<std::size_t>(i)].lambda; }
  [[nodiscard]] double box_multiplier(int k) const { return box_.lambda_low[k] + box_.lambda_high[k]; }
  [[nodiscard]] double momentum_multiplier(int k) const {
    return momentum_box_.lambda_low[k] + momentum_box_.lambda_high[k];
  }
  [[nodiscard]] int row_count() const noexcept { return count_; }

 private:
  struct Row {
    double b = 0.0, floor = 0.0, weight = 0.0, lambda = 0.0;
  };
  /// One pass over rows, box or momentum box; the largest square of a move of x in the metric.
  double pass_rows(Eigen::VectorXd& x);
  double pass_box(Eigen::VectorXd& x);
  double pass_momentum_box(Eigen::VectorXd& x);
  /// Σ λ_i b_i over what has b_i > 0.
  [[nodiscard]] double recovery() const;

  const Eigen::MatrixXd* M_ = nullptr;
  const Eigen::MatrixXd* W_ = nullptr;
  Eigen::MatrixXd a_, Wa_;  ///< one column a row
  std::vector<Row> rows_;
  int count_ = 0;
  bool has_momentum_box_ = false;
  Box box_, momentum_box_;
  Eigen::VectorXd Mx_, step_, Mfrom_;
};

}  // namespace hamelin::hybrid

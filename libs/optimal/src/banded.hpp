#pragma once
#include <Eigen/Core>
#include <vector>

namespace hamelin::optimal {

/// A symmetric positive definite matrix of n × n blocks with a block bandwidth, bordered by one row
/// and column:
///     [ H  g ]
///     [ gᵀ c ]
/// factored by blocks in O(blocks · n³ · bandwidth²).
class BandedMatrix {
 public:
  /// @param reach blocks right of the diagonal @param bordered whether there is a border
  BandedMatrix(Eigen::Index blocks, Eigen::Index n, Eigen::Index reach, bool bordered);

  void set_zero();
  /// The block of rows `row` and columns `column` ≤ row ≤ column + reach, of which the diagonal
  /// ones are read below their diagonal only.
  [[nodiscard]] auto block(Eigen::Index row, Eigen::Index column) {
    return panels_[static_cast<std::size_t>(column)].middleRows((row - column) * n_, n_);
  }
  [[nodiscard]] auto block(Eigen::Index row, Eigen::Index column) const {
    return panels_[static_cast<std::size_t>(column)].middleRows((row - column) * n_, n_);
  }
  [[nodiscard]] Eigen::VectorXd& border() noexcept { return border_; }
  [[nodiscard]] const Eigen::VectorXd& border() const noexcept { return border_; }
  [[nodiscard]] double& corner() noexcept { return corner_; }
  [[nodiscard]] double corner() const noexcept { return corner_; }

  [[nodiscard]] Eigen::Index blocks() const noexcept {
    return static_cast<Eigen::Index>(panels_.size());
  }
  [[nodiscard]] Eigen::Index reach() const noexcept { return reach_; }
  [[nodiscard]] bool bordered() const noexcept { return bordered_; }

  /// Factors this plus `shift` times the identity, which destroys the matrix.
  /// @return false if it is not positive definite
  [[nodiscard]] bool factor(double shift);
  /// Solves in place, with the factors. @param x as long as the matrix
  void solve(Eigen::VectorXd& x) const;

 private:
  void solve_band(Eigen::Ref<Eigen::VectorXd> x) const;

  Eigen::Index n_, reach_;
  bool bordered_;
  std::vector<Eigen::MatrixXd> panels_;  ///< per column: the diagonal block and those below it
  Eigen::VectorXd border_;
  double corner_ = 0.0;
  Eigen::VectorXd border_solved_;  ///< H⁻¹ g
};

}  // namespace hamelin::optimal

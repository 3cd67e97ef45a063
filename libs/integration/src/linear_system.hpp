#pragma once
#include <Eigen/Core>
#include <vector>

#include "hamelin/core/isa.hpp"
#include "kernel/linear.hpp"

namespace hamelin::integration {

using RowMatrixXd = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The next multiple of kernel::row_multiple.
[[nodiscard]] inline Eigen::Index padded(Eigen::Index n) noexcept {
  return static_cast<Eigen::Index>(kernel::padded(static_cast<std::size_t>(n)));
}

/// Small dense products and equations in memory that is allocated once. Matrices have padded
/// columns; those beyond what was asked for are zero.
class LinearSystem {
 public:
  /// S X = R with n rows and this number of columns.
  LinearSystem(Eigen::Index n, Eigen::Index columns, Isa isa);

  /// S and R, to be written before each solve(), which destroys them.
  [[nodiscard]] auto matrix() { return rows_.leftCols(rows_.rows()); }
  [[nodiscard]] auto right() { return rows_.middleCols(padded(rows_.rows()), columns_); }
  /// @return false if S is singular or not finite
  [[nodiscard]] bool solve();
  /// X
  [[nodiscard]] const RowMatrixXd& solution() const noexcept { return solution_; }
  /// out += A B
  void add_product(const RowMatrixXd& A, const RowMatrixXd& B, RowMatrixXd& out) const;

 private:
  const kernel::LinearKernels* kernels_;
  Eigen::Index columns_;
  RowMatrixXd rows_, solution_;
  std::vector<double*> given_, order_;
};

}  // namespace hamelin::integration

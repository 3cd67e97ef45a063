#include "linear_system.hpp"

#include "hamelin/core/isa_kernels.hpp"

namespace hamelin::integration {

using Eigen::Index;

namespace kernel {

HAMELIN_SELECT_KERNELS(LinearKernels, linear_set)

}  // namespace kernel

LinearSystem::LinearSystem(Index n, Index columns, Isa isa)
    : kernels_(&kernel::select_linear_set(isa)),
      columns_(columns),
      rows_(RowMatrixXd::Zero(n, padded(n) + padded(columns))),
      solution_(RowMatrixXd::Zero(n, padded(columns))),
      order_(static_cast<std::size_t>(n)) {
  for (Index i = 0; i < n; ++i) given_.push_back(rows_.row(i).data());
}

bool LinearSystem::solve() {
  const auto n = order_.size(), width = static_cast<std::size_t>(solution_.cols());
  const bool solved = kernels_->solve(n, width, given_.data(), order_.data());
  for (std::size_t i = 0; i < n; ++i)
    solution_.row(static_cast<Index>(i)) =
        Eigen::Map<const Eigen::RowVectorXd>(order_[i] + kernel::padded(n), solution_.cols());
  return solved && solution_.allFinite();
}

void LinearSystem::add_product(const RowMatrixXd& A, const RowMatrixXd& B, RowMatrixXd& out) const {
  const auto size = [](Index n) { return static_cast<std::size_t>(n); };
  kernels_->add_product(size(A.rows()), size(B.rows()), size(B.cols()), A.data(),
                        size(A.outerStride()), B.data(), size(B.outerStride()), out.data(),
                        size(out.outerStride()));
}

}  // namespace hamelin::integration

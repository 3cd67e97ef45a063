#include "linear_system.hpp"

#include "hamelin/core/isa_kernels.hpp"

namespace hamelin::integration {

using Eigen::Index;

namespace kernel {

HAMELIN_SELECT_KERNELS(LinearKernels, linear_set)

}  // namespace kernel

namespace {

std::size_t size(Index n) {
  return static_cast<std::size_t>(n);
}

}  // namespace

LinearSystem::LinearSystem(Index n, Index columns, Isa isa)
    : kernels_(&kernel::select_linear_set(isa)),
      columns_(columns),
      rows_(RowMatrixXd::Zero(n, padded(n) + padded(columns) + padded(1))),
      factors_(RowMatrixXd::Zero(n, padded(1))) {}

bool LinearSystem::solve() {
  return kernels_->solve(size(rows_.rows()), size(padded(columns_)), rows_.data(),
                         size(rows_.outerStride()), factors_.data());
}

void LinearSystem::subtract_product(const RowMatrixXd& A, RowMatrixXd& out) const {
  kernels_->subtract_product(size(A.rows()), size(rows_.rows()), size(padded(columns_)), A.data(),
                             size(A.outerStride()), solution().data(), size(rows_.outerStride()),
                             out.data(), size(out.outerStride()));
}

}  // namespace hamelin::integration

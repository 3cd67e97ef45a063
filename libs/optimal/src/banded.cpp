#include "banded.hpp"

#include <Eigen/Cholesky>
#include <algorithm>

namespace hamelin::optimal {

using Eigen::Index;
using Eigen::VectorXd;

BandedMatrix::BandedMatrix(Index blocks, Index n, Index reach, bool bordered)
    : n_(n),
      reach_(reach),
      bordered_(bordered),
      border_(VectorXd::Zero(bordered ? blocks * n : 0)) {
  for (Index k = 0; k < blocks; ++k)
    panels_.push_back(Eigen::MatrixXd::Zero((std::min(reach, blocks - 1 - k) + 1) * n, n));
}

void BandedMatrix::set_zero() {
  for (auto& panel : panels_) panel.setZero();
  border_.setZero();
  corner_ = 0.0;
}

bool BandedMatrix::factor(double shift) {
  for (Index k = 0; k < blocks(); ++k) {
    auto& panel = panels_[static_cast<std::size_t>(k)];
    auto diagonal = panel.topRows(n_);
    diagonal.diagonal().array() += shift;
    Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> cholesky(diagonal);
    if (cholesky.info() != Eigen::Success || !diagonal.diagonal().allFinite()) return false;
    const Index below = panel.rows() / n_ - 1;
    if (below == 0) continue;
    auto rest = panel.bottomRows(below * n_);
    diagonal.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(rest);
    for (Index j = 0; j < below; ++j)
      panels_[static_cast<std::size_t>(k + 1 + j)].topRows((below - j) * n_).noalias() -=
          rest.bottomRows((below - j) * n_) * rest.middleRows(j * n_, n_).transpose();
  }
  if (!bordered_) return true;
  border_solved_ = border_;
  solve_band(border_solved_);
  corner_ += shift - border_.dot(border_solved_);
  return corner_ > 0.0;
}

void BandedMatrix::solve_band(Eigen::Ref<VectorXd> x) const {
  for (Index k = 0; k < blocks(); ++k) {
    const auto& panel = panels_[static_cast<std::size_t>(k)];
    auto here = x.segment(k * n_, n_);
    panel.topRows(n_).triangularView<Eigen::Lower>().solveInPlace(here);
    const Index below = panel.rows() - n_;
    x.segment((k + 1) * n_, below).noalias() -= panel.bottomRows(below) * here;
  }
  for (Index k = blocks(); k-- > 0;) {
    const auto& panel = panels_[static_cast<std::size_t>(k)];
    auto here = x.segment(k * n_, n_);
    const Index below = panel.rows() - n_;
    here.noalias() -= panel.bottomRows(below).transpose() * x.segment((k + 1) * n_, below);
    panel.topRows(n_).triangularView<Eigen::Lower>().transpose().solveInPlace(here);
  }
}

void BandedMatrix::solve(VectorXd& x) const {
  const Index size = blocks() * n_;
  solve_band(x.head(size));
  if (!bordered_) return;
  x[size] = (x[size] - border_.dot(x.head(size))) / corner_;
  x.head(size) -= x[size] * border_solved_;
}

}  // namespace hamelin::optimal

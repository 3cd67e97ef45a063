#include "hamelin/identification/pseudo_inertia.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>
#include <utility>

#include "hamelin/core/numbers.hpp"

namespace hamelin::identification {

namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;

constexpr std::array<std::pair<int, int>, 10> basis_entries{
    {{0, 0}, {1, 1}, {2, 2}, {3, 3}, {0, 1}, {0, 2}, {1, 2}, {0, 3}, {1, 3}, {2, 3}}};

constexpr double definite_share = 1e-9;  ///< of the largest moment: less counts as zero
constexpr double repaired_share = 1e-4;

}  // namespace

// docs/theory.md (2.51)
Matrix4d pseudo_inertia(const LinkParameters& parameters) {
  Matrix3d inertia;
  inertia << parameters[4], parameters[7], parameters[8],  //
      parameters[7], parameters[5], parameters[9],         //
      parameters[8], parameters[9], parameters[6];
  Matrix4d out;
  out.topLeftCorner<3, 3>() = 0.5 * inertia.trace() * Matrix3d::Identity() - inertia;
  out.topRightCorner<3, 1>() = parameters.segment<3>(1);
  out.bottomLeftCorner<1, 3>() = parameters.segment<3>(1).transpose();
  out(3, 3) = parameters[0];
  return out;
}

LinkParameters link_parameters(const Matrix4d& pseudo_inertia) {
  const Matrix4d P = 0.5 * (pseudo_inertia + pseudo_inertia.transpose());
  const Matrix3d moments = P.topLeftCorner<3, 3>();
  const Matrix3d inertia = moments.trace() * Matrix3d::Identity() - moments;
  LinkParameters out;
  out << P(3, 3), P.topRightCorner<3, 1>(), inertia(0, 0), inertia(1, 1), inertia(2, 2),
      inertia(0, 1), inertia(0, 2), inertia(1, 2);
  return out;
}

Matrix4d symmetric_basis(int i) {
  const auto [row, column] = basis_entries[static_cast<std::size_t>(i)];
  Matrix4d out = Matrix4d::Zero();
  out(row, column) = out(column, row) = row == column ? 1.0 : std::sqrt(0.5);
  return out;
}

LinkCoordinates::LinkCoordinates(const LinkParameters& prior) : prior_(prior) {
  Matrix4d P = pseudo_inertia(prior);
  const Vector3d center = prior.segment<3>(1) / prior[0];
  const Matrix3d about_center = P.topLeftCorner<3, 3>() - prior[0] * center * center.transpose();
  const Eigen::SelfAdjointEigenSolver<Matrix3d> moments(about_center);
  const double largest = moments.eigenvalues()[2];
  repaired_ = moments.eigenvalues()[0] <= definite_share * largest;
  if (repaired_) {
    const Vector3d raised = moments.eigenvalues().cwiseMax(repaired_share * largest);
    P.topLeftCorner<3, 3>() += moments.eigenvectors() *
                               (raised - moments.eigenvalues()).asDiagonal() *
                               moments.eigenvectors().transpose();
    prior_ = link_parameters(P);
  }
  const Matrix4d L = P.llt().matrixL();
  for (int i = 0; i < 10; ++i)
    to_parameters_.col(i) = link_parameters(L * symmetric_basis(i) * L.transpose());
}

Divergence divergence(const LinkParameters& z) {
  Matrix4d shifted = Matrix4d::Identity();
  for (int i = 0; i < 10; ++i) shifted += z[i] * symmetric_basis(i);
  Divergence out;
  const Eigen::LLT<Matrix4d> factor(shifted);
  if (factor.info() != Eigen::Success || !shifted.allFinite()) {
    out.value = infinity;
    return out;
  }
  const Matrix4d lower = factor.matrixL();
  out.value = shifted.trace() - 4.0 - 2.0 * lower.diagonal().array().log().sum();
  const Matrix4d inverse = factor.solve(Matrix4d::Identity());
  std::array<Matrix4d, 10> turned;
  for (int i = 0; i < 10; ++i) {
    turned[static_cast<std::size_t>(i)] = inverse * symmetric_basis(i);
    out.gradient[i] = symmetric_basis(i).trace() - turned[static_cast<std::size_t>(i)].trace();
  }
  for (int i = 0; i < 10; ++i)
    for (int k = 0; k <= i; ++k)
      out.hessian(i, k) = out.hessian(k, i) =
          (turned[static_cast<std::size_t>(i)] * turned[static_cast<std::size_t>(k)]).trace();
  return out;
}

}  // namespace hamelin::identification

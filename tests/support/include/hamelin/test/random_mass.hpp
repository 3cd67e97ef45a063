#pragma once
#include <Eigen/Dense>

#include "hamelin/core/rng.hpp"

namespace hamelin::test {

inline Eigen::VectorXd random_numbers(Rng& rng, int n, double size = 1.0) {
  Eigen::VectorXd x(n);
  for (int i = 0; i < n; ++i) x[i] = rng.uniform(-size, size);
  return x;
}

/// A random symmetric positive definite matrix.
inline Eigen::MatrixXd random_mass(Rng& rng, int n) {
  Eigen::MatrixXd A(n, n);
  for (int j = 0; j < n; ++j) A.col(j) = random_numbers(rng, n);
  return A * A.transpose() + 0.05 * Eigen::MatrixXd::Identity(n, n);
}

}  // namespace hamelin::test

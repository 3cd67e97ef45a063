#include "hamelin/dynamics/damped_inverse.hpp"

#include <Eigen/SVD>
#include <catch2/catch.hpp>

namespace hamelin::dynamics {

TEST_CASE("the damped inverse is that of the singular values", "[dynamics][unit]") {
  const Matrix6Xd J = Matrix6Xd::Random(6, 7);
  const geometry::Vector6d error = geometry::Vector6d::Random();
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(J, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const auto expected = [&](double damping) -> Eigen::VectorXd {
    const Eigen::ArrayXd s = svd.singularValues();
    const Eigen::VectorXd shares = (s / (s * s + damping)).matrix();
    return svd.matrixV() * shares.cwiseProduct(svd.matrixU().transpose() * error);
  };
  DampedInverse inverse;
  Eigen::VectorXd step(7);
  inverse.factor(J, 0.3);
  inverse.apply(J, error, step);
  CHECK((step - expected(0.3)).norm() < 1e-13);

  const double trace = (J * J.transpose()).trace();
  inverse.factor_relative(J, 0.2, 1e-6);
  inverse.apply(J, error, step);
  CHECK((step - expected(0.2 * trace)).norm() < 1e-13);
  inverse.damp_relative(0.01);
  inverse.apply(J, error, step);
  CHECK((step - expected(0.01 * trace)).norm() < 1e-12);
  const Matrix6Xd small = 1e-9 * J;  // its trace is below the least one
  inverse.factor_relative(small, 0.2, 1e-6);
  inverse.apply(small, error, step);
  CHECK((step - small.transpose() * error / 2e-7).norm() < 1e-12);
}

}  // namespace hamelin::dynamics

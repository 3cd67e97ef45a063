#pragma once
#include <Eigen/Core>
#include <complex>
#include <vector>

#include "hamelin/model/model.hpp"

namespace hamelin::test {

/// Inverse dynamics for complex joint vectors, whose imaginary part at a step of 1e-30 is the exact
/// derivative. Newton–Euler in the COM frames with products of exponentials, after K. M. Lynch, F.
/// C. Park, Modern Robotics, 2017, section 8.3.2: neither the frames nor the sweeps of the library.
class ComplexInverseDynamics {
 public:
  using C = std::complex<double>;
  using VectorXc = Eigen::Matrix<C, Eigen::Dynamic, 1>;
  using Matrix6c = Eigen::Matrix<C, 6, 6>;
  using Vector6c = Eigen::Matrix<C, 6, 1>;

  explicit ComplexInverseDynamics(const model::Model& model) : model_(model) {}

  [[nodiscard]] VectorXc operator()(const VectorXc& q, const VectorXc& v, const VectorXc& a) const {
    const auto& links = model_.robot().links;
    const std::size_t n = links.size();
    std::vector<Matrix6c> Ad(n);
    std::vector<Vector6c> A(n), V(n), dV(n);
    Vector6c twist = Vector6c::Zero(), rate = Vector6c::Zero();
    rate.tail<3>() = -(model_.base().R().transpose() * model_.gravity()).cast<C>();
    geometry::SE3 before;
    for (std::size_t i = 0; i < n; ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      A[i] = (links[i].com.inverse().Ad() * links[i].joint.screw).cast<C>();
      const geometry::SE3 at_zero = links[i].com.inverse() * before;
      Ad[i] = adjoint_of_exp(A[i], -q[k]) * at_zero.Ad().cast<C>();
      twist = V[i] = Ad[i] * twist + A[i] * v[k];
      rate = dV[i] = Ad[i] * rate + ad(V[i]) * A[i] * v[k] + A[i] * a[k];
      before = links[i].com;
    }
    VectorXc tau(q.size());
    Vector6c wrench = Vector6c::Zero();
    for (std::size_t i = n; i-- > 0;) {
      const auto k = static_cast<Eigen::Index>(i);
      Matrix6c G = Matrix6c::Zero();
      G.topLeftCorner<3, 3>() = links[i].inertia_kg_m2.cast<C>();
      G.bottomRightCorner<3, 3>() = (links[i].mass_kg * Eigen::Matrix3d::Identity()).cast<C>();
      if (i + 1 < n) wrench = (Ad[i + 1].transpose() * wrench).eval();
      wrench += G * dV[i] - ad(V[i]).transpose() * (G * V[i]);
      tau[k] = wrench.cwiseProduct(A[i]).sum() + links[i].joint.armature * a[k];
    }
    return tau;
  }

 private:
  using Matrix3c = Eigen::Matrix<C, 3, 3>;
  using Vector3c = Eigen::Matrix<C, 3, 1>;

  static Matrix3c hat(const Vector3c& w) {
    Matrix3c m;
    m << C(0), -w[2], w[1], w[2], C(0), -w[0], -w[1], w[0], C(0);
    return m;
  }
  static Matrix6c ad(const Vector6c& m) {
    Matrix6c out = Matrix6c::Zero();
    out.topLeftCorner<3, 3>() = out.bottomRightCorner<3, 3>() = hat(m.head<3>());
    out.bottomLeftCorner<3, 3>() = hat(m.tail<3>());
    return out;
  }
  /// Ad(exp(A s)) for a screw without pitch.
  static Matrix6c adjoint_of_exp(const Vector6c& A, C s) {
    const Vector3c w = A.head<3>(), u = A.tail<3>();
    const Matrix3c W = hat(w), one = Matrix3c::Identity();
    const bool turns = w.cwiseAbs().maxCoeff() > 0.5;
    const Matrix3c R = turns ? Matrix3c(one + std::sin(s) * W + (1.0 - std::cos(s)) * W * W) : one;
    const Vector3c p = turns ? Vector3c((one - R) * (W * u)) : Vector3c(u * s);
    Matrix6c out = Matrix6c::Zero();
    out.topLeftCorner<3, 3>() = out.bottomRightCorner<3, 3>() = R;
    out.bottomLeftCorner<3, 3>() = hat(p) * R;
    return out;
  }

  const model::Model& model_;
};

}  // namespace hamelin::test

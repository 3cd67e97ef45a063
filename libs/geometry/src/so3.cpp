#include "hamelin/geometry/so3.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <string>

#include "hamelin/core/error.hpp"
#include "hamelin/geometry/dexp_coefficients.hpp"

namespace hamelin::geometry {

Eigen::Matrix3d hat(const Eigen::Vector3d& x) {
  return (Eigen::Matrix3d() << 0.0, -x.z(), x.y(), x.z(), 0.0, -x.x(), -x.y(), x.x(), 0.0)
      .finished();
}

Eigen::Vector3d vee(const Eigen::Matrix3d& m) {
  return 0.5 * Eigen::Vector3d(m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1));
}

Eigen::Vector4d quaternion_wxyz(const Eigen::Matrix3d& R) {
  const Eigen::Quaterniond q(R);
  Eigen::Vector4d wxyz(q.w(), q.x(), q.y(), q.z());
  wxyz.normalize();
  return q.w() < 0.0 ? Eigen::Vector4d(-wxyz) : wxyz;
}

Eigen::Matrix3d rotation_from_wxyz(const Eigen::Vector4d& wxyz) {
  constexpr double tolerance = 1e-6;
  const double norm = wxyz.norm();
  if (!(std::abs(norm - 1.0) <= tolerance)) {
    throw Error(ErrorCode::invalid,
                "quaternion_wxyz: the norm is " + std::to_string(norm) + ", expected 1 (to 1e-6)");
  }
  return Eigen::Quaterniond(wxyz[0] / norm, wxyz[1] / norm, wxyz[2] / norm, wxyz[3] / norm)
      .toRotationMatrix();
}

// By the quaternion whose half angle is that between `from` and the middle of both.
Eigen::Matrix3d rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d a = from.normalized(), b = to.normalized();
  const double twice_cos = (a + b).norm();
  constexpr double opposite = 1e-8;  // nearer to it, the axis is lost to rounding
  if (twice_cos < opposite) {
    const Eigen::Vector3d axis = a.unitOrthogonal();
    return 2.0 * axis * axis.transpose() - Eigen::Matrix3d::Identity();
  }
  const Eigen::Vector3d v = a.cross(b) / twice_cos;
  return Eigen::Quaterniond(0.5 * twice_cos, v.x(), v.y(), v.z()).normalized().toRotationMatrix();
}

SO3 SO3::exp(const Tangent& omega) {
  const ExpCoefficients c = exp_coefficients(omega.squaredNorm());
  const Matrix W = geometry::hat(omega);
  return SO3(Matrix::Identity() + c.sinc * W + c.a * (W * W));
}

SO3::Tangent SO3::log() const {
  const Eigen::Vector4d q = quaternion_wxyz(R_);
  const double n = q.tail<3>().norm();
  const double scale = n < log_threshold ? 2.0 : 2.0 * std::atan2(n, q[0]) / n;
  return scale * q.tail<3>();
}

SO3::Tangent SO3::Ad(const Tangent& x) const {
  return R_ * x;
}

SO3::Tangent SO3::Ad_T(const Tangent& y) const {
  return R_.transpose() * y;
}

SO3::Adjoint SO3::ad(const Tangent& x) {
  return geometry::hat(x);
}

SO3::Tangent SO3::ad(const Tangent& x, const Tangent& y) {
  return x.cross(y);
}

SO3::Tangent SO3::ad_T(const Tangent& x, const Tangent& y) {
  return y.cross(x);
}

SO3::Adjoint SO3::dexp(const Tangent& omega) {
  const ExpCoefficients c = exp_coefficients(omega.squaredNorm());
  const Matrix W = geometry::hat(omega);
  return Matrix::Identity() + c.a * W + c.b * (W * W);
}

SO3::Adjoint SO3::dexp_inv(const Tangent& omega) {
  const Matrix W = geometry::hat(omega);
  return Matrix::Identity() - 0.5 * W + inverse_exp_coefficients(omega.squaredNorm()).e * (W * W);
}

SO3::Matrix SO3::hat(const Tangent& x) {
  return geometry::hat(x);
}

SO3::Tangent SO3::vee(const Matrix& m) {
  return geometry::vee(m);
}

SO3 SO3::inverse() const {
  return SO3(R_.transpose());
}

bool SO3::operator==(const SO3& other) const {
  return R_ == other.R_;
}

}  // namespace hamelin::geometry

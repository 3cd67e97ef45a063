#include "hamelin/geometry/se3.hpp"

#include <Eigen/Geometry>

#include "hamelin/geometry/dexp_coefficients.hpp"

namespace hamelin::geometry {

namespace {

// [diagonal 0; lower diagonal]
SE3::Adjoint blocks(const Eigen::Matrix3d& diagonal, const Eigen::Matrix3d& lower) {
  SE3::Adjoint m;
  m << diagonal, Eigen::Matrix3d::Zero(), lower, diagonal;
  return m;
}

}  // namespace

SE3::Matrix SE3::matrix() const {
  Matrix m = Matrix::Identity();
  m.topLeftCorner<3, 3>() = R_;
  m.topRightCorner<3, 1>() = p_;
  return m;
}

SE3 SE3::inverse() const {
  return {R_.transpose(), -(R_.transpose() * p_)};
}

bool SE3::operator==(const SE3& other) const {
  return R_ == other.R_ && p_ == other.p_;
}

SE3 SE3::exp(const Tangent& x) {
  const Eigen::Vector3d omega = x.head<3>(), v = x.tail<3>();
  const ExpCoefficients c = exp_coefficients(omega.squaredNorm());
  const Eigen::Matrix3d W = geometry::hat(omega);
  const Eigen::Vector3d w_v = omega.cross(v);
  return {Eigen::Matrix3d::Identity() + c.sinc * W + c.a * (W * W),
          v + c.a * w_v + c.b * omega.cross(w_v)};
}

SE3::Tangent SE3::log() const {
  const Eigen::Vector3d omega = SO3(R_).log();
  const Eigen::Vector3d w_p = omega.cross(p_);
  const double e = inverse_exp_coefficients(omega.squaredNorm()).e;
  return (Tangent() << omega, p_ - 0.5 * w_p + e * omega.cross(w_p)).finished();
}

SE3::Adjoint SE3::Ad() const {
  return blocks(R_, geometry::hat(p_) * R_);
}

SE3::Tangent SE3::Ad(const Tangent& x) const {
  const Eigen::Vector3d omega = R_ * x.head<3>();
  return (Tangent() << omega, R_ * x.tail<3>() + p_.cross(omega)).finished();
}

SE3::Tangent SE3::Ad_T(const Tangent& y) const {
  const Eigen::Vector3d f = y.tail<3>();
  return (Tangent() << R_.transpose() * (y.head<3>() - p_.cross(f)), R_.transpose() * f).finished();
}

SE3::Adjoint SE3::ad(const Tangent& x) {
  return blocks(geometry::hat(x.head<3>()), geometry::hat(x.tail<3>()));
}

SE3::Tangent SE3::ad(const Tangent& x, const Tangent& y) {
  const Eigen::Vector3d omega = x.head<3>(), v = x.tail<3>(), omega_y = y.head<3>(),
                        v_y = y.tail<3>();
  return (Tangent() << omega.cross(omega_y), v.cross(omega_y) + omega.cross(v_y)).finished();
}

SE3::Tangent SE3::ad_T(const Tangent& x, const Tangent& y) {
  const Eigen::Vector3d omega = x.head<3>(), v = x.tail<3>(), m = y.head<3>(), f = y.tail<3>();
  return (Tangent() << m.cross(omega) + f.cross(v), f.cross(omega)).finished();
}

SE3::Adjoint SE3::dexp(const Tangent& x) {
  const Eigen::Vector3d omega = x.head<3>(), v = x.tail<3>();
  const ExpCoefficients c = exp_coefficients(omega.squaredNorm());
  const Eigen::Matrix3d W = geometry::hat(omega), V = geometry::hat(v), WW = W * W, WV = W * V;
  const double along = omega.dot(v);
  return blocks(Eigen::Matrix3d::Identity() + c.a * W + c.b * WW,
                c.a * V + c.b * (WV + WV.transpose()) + along * (c.da * W + c.db * WW));
}

SE3::Adjoint SE3::dexp_inv(const Tangent& x) {
  const Eigen::Vector3d omega = x.head<3>(), v = x.tail<3>();
  const InverseExpCoefficients c = inverse_exp_coefficients(omega.squaredNorm());
  const Eigen::Matrix3d W = geometry::hat(omega), V = geometry::hat(v), WW = W * W, WV = W * V;
  return blocks(Eigen::Matrix3d::Identity() - 0.5 * W + c.e * WW,
                -0.5 * V + c.e * (WV + WV.transpose()) + omega.dot(v) * c.de * WW);
}

SE3::Matrix SE3::hat(const Tangent& x) {
  Matrix m = Matrix::Zero();
  m.topLeftCorner<3, 3>() = geometry::hat(x.head<3>());
  m.topRightCorner<3, 1>() = x.tail<3>();
  return m;
}

SE3::Tangent SE3::vee(const Matrix& m) {
  return (Tangent() << geometry::vee(m.topLeftCorner<3, 3>()), m.topRightCorner<3, 1>()).finished();
}

}  // namespace hamelin::geometry

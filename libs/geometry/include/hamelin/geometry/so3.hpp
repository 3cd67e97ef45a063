#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <string>

#include "hamelin/core/error.hpp"
#include "hamelin/geometry/dexp_coefficients.hpp"
#include "hamelin/geometry/eigen_alignment.hpp"
#include "hamelin/geometry/lie_group.hpp"

namespace hamelin::geometry {

/// x̂ with x̂ y = x × y.
[[nodiscard]] inline Eigen::Matrix3d hat(const Eigen::Vector3d& x) {
  return (Eigen::Matrix3d() << 0.0, -x.z(), x.y(), x.z(), 0.0, -x.x(), -x.y(), x.x(), 0.0).finished();
}

/// The inverse of hat; of a matrix that is not skew, its skew part.
[[nodiscard]] inline Eigen::Vector3d vee(const Eigen::Matrix3d& m) {
  return 0.5 * Eigen::Vector3d(m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1));
}

/// Unit quaternion (w, x, y, z) of a rotation matrix, w ≥ 0; accurate at every angle (Shepperd 1978).
[[nodiscard]] inline Eigen::Vector4d quaternion_wxyz(const Eigen::Matrix3d& R) {
  const Eigen::Quaterniond q(R);
  Eigen::Vector4d wxyz(q.w(), q.x(), q.y(), q.z());
  wxyz.normalize();
  return q.w() < 0.0 ? Eigen::Vector4d(-wxyz) : wxyz;
}

/// Rotation matrix of a quaternion (w, x, y, z), normalised first.
/// @throws Error invalid unless the norm is 1 to 1e-6
[[nodiscard]] inline Eigen::Matrix3d rotation_from_wxyz(const Eigen::Vector4d& wxyz) {
  constexpr double tolerance = 1e-6;
  const double norm = wxyz.norm();
  if (!(std::abs(norm - 1.0) <= tolerance)) {
    throw Error(ErrorCode::invalid, "quaternion_wxyz: the norm is " + std::to_string(norm) + ", expected 1 (to 1e-6)");
  }
  return Eigen::Quaterniond(wxyz[0] / norm, wxyz[1] / norm, wxyz[2] / norm, wxyz[3] / norm).toRotationMatrix();
}

/// Rotation of space, kept as a matrix. A value; the default is the identity.
class SO3 {
 public:
  static constexpr int dof = 3;
  using Tangent = Eigen::Vector3d;
  using Adjoint = Eigen::Matrix3d;
  using Point = Eigen::Vector3d;
  using Matrix = Eigen::Matrix3d;

  SO3() = default;
  /// @param R a rotation matrix; not checked
  explicit SO3(const Matrix& R) : R_(R) {}

  [[nodiscard]] const Matrix& R() const noexcept { return R_; }
  [[nodiscard]] const Matrix& matrix() const noexcept { return R_; }

  [[nodiscard]] SO3 operator*(const SO3& other) const { return SO3(R_ * other.R_); }
  [[nodiscard]] Point operator*(const Point& point) const { return R_ * point; }
  [[nodiscard]] Point act(const Point& point) const { return R_ * point; }
  [[nodiscard]] SO3 inverse() const { return SO3(R_.transpose()); }
  [[nodiscard]] bool operator==(const SO3& other) const { return R_ == other.R_; }

  /// 1 + (sin θ/θ) ω̂ + ((1 − cos θ)/θ²) ω̂², (2) of the paper with its coefficient corrected.
  [[nodiscard]] static SO3 exp(const Tangent& omega) {
    const ExpCoefficients c = exp_coefficients(omega.squaredNorm());
    const Matrix W = geometry::hat(omega);
    return SO3(Matrix::Identity() + c.sinc * W + c.a * (W * W));
  }

  /// Below this sine of the half angle asin(n)/n is 1 to rounding (order 0, error n²/6 < 2e-17).
  static constexpr double log_threshold = 1e-8;

  /// The shortest rotation vector, |ω| ≤ π; at π exactly, of the two the one whose largest component is positive.
  [[nodiscard]] Tangent log() const {
    const Eigen::Vector4d q = quaternion_wxyz(R_);
    const double n = q.tail<3>().norm();
    const double scale = n < log_threshold ? 2.0 : 2.0 * std::atan2(n, q[0]) / n;
    return scale * q.tail<3>();
  }

  [[nodiscard]] const Adjoint& Ad() const noexcept { return R_; }
  [[nodiscard]] Tangent Ad(const Tangent& x) const { return R_ * x; }
  [[nodiscard]] Tangent Ad_T(const Tangent& y) const { return R_.transpose() * y; }
  [[nodiscard]] static Adjoint ad(const Tangent& x) { return geometry::hat(x); }
  [[nodiscard]] static Tangent ad(const Tangent& x, const Tangent& y) { return x.cross(y); }
  [[nodiscard]] static Tangent ad_T(const Tangent& x, const Tangent& y) { return y.cross(x); }

  /// 1 + a ω̂ + b ω̂².
  [[nodiscard]] static Adjoint dexp(const Tangent& omega) {
    const ExpCoefficients c = exp_coefficients(omega.squaredNorm());
    const Matrix W = geometry::hat(omega);
    return Matrix::Identity() + c.a * W + c.b * (W * W);
  }
  /// 1 − ω̂/2 + e ω̂²; singular at |ω| = 2π.
  [[nodiscard]] static Adjoint dexp_inv(const Tangent& omega) {
    const Matrix W = geometry::hat(omega);
    return Matrix::Identity() - 0.5 * W + inverse_exp_coefficients(omega.squaredNorm()).e * (W * W);
  }

  [[nodiscard]] static Matrix hat(const Tangent& x) { return geometry::hat(x); }
  [[nodiscard]] static Tangent vee(const Matrix& m) { return geometry::vee(m); }

 private:
  Matrix R_ = Matrix::Identity();
};

static_assert(LieGroup<SO3>);

}  // namespace hamelin::geometry

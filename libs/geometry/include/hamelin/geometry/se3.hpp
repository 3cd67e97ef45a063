#pragma once
#include <Eigen/Core>

#include "hamelin/geometry/dexp_coefficients.hpp"
#include "hamelin/geometry/lie_group.hpp"
#include "hamelin/geometry/so3.hpp"

namespace hamelin::geometry {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// Displacement of space. Twists are [ω; v], wrenches [moment; force]. A value; the default is the identity.
class SE3 {
 public:
  static constexpr int dof = 6;
  using Tangent = Vector6d;
  using Adjoint = Matrix6d;
  using Point = Eigen::Vector3d;
  using Matrix = Eigen::Matrix4d;

  SE3() = default;
  /// @param R a rotation matrix; not checked
  /// @param p the moved frame's origin [m]
  SE3(const Eigen::Matrix3d& R, const Eigen::Vector3d& p) : R_(R), p_(p) {}

  [[nodiscard]] const Eigen::Matrix3d& R() const noexcept { return R_; }
  [[nodiscard]] const Eigen::Vector3d& p() const noexcept { return p_; }
  /// 4 × 4 homogeneous matrix.
  [[nodiscard]] Matrix matrix() const {
    Matrix m = Matrix::Identity();
    m.topLeftCorner<3, 3>() = R_;
    m.topRightCorner<3, 1>() = p_;
    return m;
  }

  [[nodiscard]] SE3 operator*(const SE3& other) const { return {R_ * other.R_, R_ * other.p_ + p_}; }
  [[nodiscard]] Point operator*(const Point& point) const { return R_ * point + p_; }
  [[nodiscard]] Point act(const Point& point) const { return R_ * point + p_; }
  [[nodiscard]] SE3 inverse() const { return {R_.transpose(), -(R_.transpose() * p_)}; }
  [[nodiscard]] bool operator==(const SE3& other) const { return R_ == other.R_ && p_ == other.p_; }

  /// R = exp ω̂ and p = dexp_ω v (dexp of SO(3)).
  [[nodiscard]] static SE3 exp(const Tangent& x) {
    const Eigen::Vector3d omega = x.head<3>(), v = x.tail<3>();
    const ExpCoefficients c = exp_coefficients(omega.squaredNorm());
    const Eigen::Matrix3d W = geometry::hat(omega);
    const Eigen::Vector3d w_v = omega.cross(v);
    return {Eigen::Matrix3d::Identity() + c.sinc * W + c.a * (W * W), v + c.a * w_v + c.b * omega.cross(w_v)};
  }
  /// ω = log R, |ω| ≤ π, as SO3::log; v = dexp_ω⁻¹ p.
  [[nodiscard]] Tangent log() const {
    const Eigen::Vector3d omega = SO3(R_).log();
    const Eigen::Vector3d w_p = omega.cross(p_);
    const double e = inverse_exp_coefficients(omega.squaredNorm()).e;
    return (Tangent() << omega, p_ - 0.5 * w_p + e * omega.cross(w_p)).finished();
  }

  /// [R 0; p̂R R]: moves a twist from the moved frame to the frame it moved from.
  [[nodiscard]] Adjoint Ad() const { return blocks(R_, geometry::hat(p_) * R_); }
  /// Ad() x without the matrix.
  [[nodiscard]] Tangent Ad(const Tangent& x) const {
    const Eigen::Vector3d omega = R_ * x.head<3>();
    return (Tangent() << omega, R_ * x.tail<3>() + p_.cross(omega)).finished();
  }
  /// Ad()ᵀ y: wrenches the other way, so that y · Ad x = Adᵀy · x [W].
  [[nodiscard]] Tangent Ad_T(const Tangent& y) const {
    const Eigen::Vector3d f = y.tail<3>();
    return (Tangent() << R_.transpose() * (y.head<3>() - p_.cross(f)), R_.transpose() * f).finished();
  }
  /// [ω̂ 0; v̂ ω̂]: ad(x) y is the bracket [x, y].
  [[nodiscard]] static Adjoint ad(const Tangent& x) {
    return blocks(geometry::hat(x.head<3>()), geometry::hat(x.tail<3>()));
  }
  /// ad(x) y without the matrix.
  [[nodiscard]] static Tangent ad(const Tangent& x, const Tangent& y) {
    const Eigen::Vector3d omega = x.head<3>(), v = x.tail<3>(), omega_y = y.head<3>(), v_y = y.tail<3>();
    return (Tangent() << omega.cross(omega_y), v.cross(omega_y) + omega.cross(v_y)).finished();
  }
  /// ad(x)ᵀ y.
  [[nodiscard]] static Tangent ad_T(const Tangent& x, const Tangent& y) {
    const Eigen::Vector3d omega = x.head<3>(), v = x.tail<3>(), m = y.head<3>(), f = y.tail<3>();
    return (Tangent() << m.cross(omega) + f.cross(v), f.cross(omega)).finished();
  }

  /// [J 0; Q J] with J = dexp_ω of SO(3) and Q its derivative along v: twists are rotation vectors over the dual
  /// numbers, ω + εv, so Q = a v̂ + b(ω̂v̂ + v̂ω̂) + (ω·v)(a'/θ ω̂ + b'/θ ω̂²).
  [[nodiscard]] static Adjoint dexp(const Tangent& x) {
    const Eigen::Vector3d omega = x.head<3>(), v = x.tail<3>();
    const ExpCoefficients c = exp_coefficients(omega.squaredNorm());
    const Eigen::Matrix3d W = geometry::hat(omega), V = geometry::hat(v), WW = W * W, WV = W * V;
    const double along = omega.dot(v);
    return blocks(Eigen::Matrix3d::Identity() + c.a * W + c.b * WW,
                  c.a * V + c.b * (WV + WV.transpose()) + along * (c.da * W + c.db * WW));
  }
  /// [J⁻¹ 0; Q' J⁻¹] with Q' = −v̂/2 + e(ω̂v̂ + v̂ω̂) + (ω·v) e'/θ ω̂²; singular at |ω| = 2π.
  [[nodiscard]] static Adjoint dexp_inv(const Tangent& x) {
    const Eigen::Vector3d omega = x.head<3>(), v = x.tail<3>();
    const InverseExpCoefficients c = inverse_exp_coefficients(omega.squaredNorm());
    const Eigen::Matrix3d W = geometry::hat(omega), V = geometry::hat(v), WW = W * W, WV = W * V;
    return blocks(Eigen::Matrix3d::Identity() - 0.5 * W + c.e * WW,
                  -0.5 * V + c.e * (WV + WV.transpose()) + omega.dot(v) * c.de * WW);
  }

  [[nodiscard]] static Matrix hat(const Tangent& x) {
    Matrix m = Matrix::Zero();
    m.topLeftCorner<3, 3>() = geometry::hat(x.head<3>());
    m.topRightCorner<3, 1>() = x.tail<3>();
    return m;
  }
  [[nodiscard]] static Tangent vee(const Matrix& m) {
    return (Tangent() << geometry::vee(m.topLeftCorner<3, 3>()), m.topRightCorner<3, 1>()).finished();
  }

 private:
  /// [diagonal 0; lower diagonal]
  [[nodiscard]] static Adjoint blocks(const Eigen::Matrix3d& diagonal, const Eigen::Matrix3d& lower) {
    Adjoint m;
    m << diagonal, Eigen::Matrix3d::Zero(), lower, diagonal;
    return m;
  }

  Eigen::Matrix3d R_ = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p_ = Eigen::Vector3d::Zero();
};

static_assert(LieGroup<SE3>);

}  // namespace hamelin::geometry

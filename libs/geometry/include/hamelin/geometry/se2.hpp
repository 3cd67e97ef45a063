#pragma once
#include <Eigen/Core>

#include "hamelin/geometry/dexp_coefficients.hpp"
#include "hamelin/geometry/lie_group.hpp"
#include "hamelin/geometry/so2.hpp"

namespace hamelin::geometry {

/// Displacement of the plane. Twists are [ω; v_x; v_y]. A value; the default is the identity.
class SE2 {
 public:
  static constexpr int dof = 3;
  using Tangent = Eigen::Vector3d;
  using Adjoint = Eigen::Matrix3d;
  using Point = Eigen::Vector2d;
  using Matrix = Eigen::Matrix3d;

  SE2() = default;
  SE2(const SO2& rotation, const Point& p) : rotation_(rotation), p_(p) {}
  /// @param angle rotation, counter-clockwise [rad]
  SE2(double angle, const Point& p) : rotation_(angle), p_(p) {}

  [[nodiscard]] const SO2& rotation() const noexcept { return rotation_; }
  [[nodiscard]] Eigen::Matrix2d R() const { return rotation_.R(); }
  [[nodiscard]] const Point& p() const noexcept { return p_; }
  /// 3 × 3 homogeneous matrix.
  [[nodiscard]] Matrix matrix() const {
    const double c = rotation_.cos(), s = rotation_.sin();
    return (Matrix() << c, -s, p_.x(), s, c, p_.y(), 0.0, 0.0, 1.0).finished();
  }

  [[nodiscard]] SE2 operator*(const SE2& other) const {
    return {rotation_ * other.rotation_, act(other.p_)};
  }
  [[nodiscard]] Point operator*(const Point& point) const { return act(point); }
  [[nodiscard]] Point act(const Point& point) const { return rotation_.act(point) + p_; }
  [[nodiscard]] SE2 inverse() const {
    const SO2 back = rotation_.inverse();
    return {back, -back.act(p_)};
  }
  [[nodiscard]] bool operator==(const SE2& other) const {
    return rotation_ == other.rotation_ && p_ == other.p_;
  }

  /// Rotation by ω and p = V v with V = (sin ω/ω) 1 + ω a J, where J is the rotation by a quarter
  /// turn. docs/theory.md (1.13).
  [[nodiscard]] static SE2 exp(const Tangent& x) {
    const ExpCoefficients c = exp_coefficients(x[0] * x[0]);
    const double off = x[0] * c.a;
    return {SO2(x[0]), Point(c.sinc * x[1] - off * x[2], off * x[1] + c.sinc * x[2])};
  }
  /// |ω| ≤ π; v = V⁻¹ p with V⁻¹ = γ 1 − (ω/2) J. docs/theory.md (1.13).
  [[nodiscard]] Tangent log() const {
    const double omega = rotation_.angle();
    const double gamma = inverse_exp_coefficients(omega * omega).gamma, half = 0.5 * omega;
    return {omega, gamma * p_.x() + half * p_.y(), gamma * p_.y() - half * p_.x()};
  }

  /// [1 0; −J p  R], docs/theory.md (1.14).
  [[nodiscard]] Adjoint Ad() const {
    const double c = rotation_.cos(), s = rotation_.sin();
    return (Adjoint() << 1.0, 0.0, 0.0, p_.y(), c, -s, -p_.x(), s, c).finished();
  }
  [[nodiscard]] Tangent Ad(const Tangent& x) const {
    const Point v = rotation_.act(x.tail<2>());
    return {x[0], v.x() + p_.y() * x[0], v.y() - p_.x() * x[0]};
  }
  [[nodiscard]] Tangent Ad_T(const Tangent& y) const {
    const Point f = rotation_.inverse().act(y.tail<2>());
    return {y[0] + p_.y() * y[1] - p_.x() * y[2], f.x(), f.y()};
  }
  /// [0 0; −J v  ω J], docs/theory.md (1.14).
  [[nodiscard]] static Adjoint ad(const Tangent& x) {
    return (Adjoint() << 0.0, 0.0, 0.0, x[2], 0.0, -x[0], -x[1], x[0], 0.0).finished();
  }
  [[nodiscard]] static Tangent ad(const Tangent& x, const Tangent& y) {
    return {0.0, x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]};
  }
  [[nodiscard]] static Tangent ad_T(const Tangent& x, const Tangent& y) {
    return {x[2] * y[1] - x[1] * y[2], x[0] * y[2], -x[0] * y[1]};
  }

  /// 1 + a ad + b ad².
  [[nodiscard]] static Adjoint dexp(const Tangent& x) {
    const ExpCoefficients c = exp_coefficients(x[0] * x[0]);
    const Adjoint A = ad(x);
    return Adjoint::Identity() + c.a * A + c.b * (A * A);
  }
  /// 1 − ad/2 + e ad²; singular at |ω| = 2π.
  [[nodiscard]] static Adjoint dexp_inv(const Tangent& x) {
    const Adjoint A = ad(x);
    return Adjoint::Identity() - 0.5 * A + inverse_exp_coefficients(x[0] * x[0]).e * (A * A);
  }

  [[nodiscard]] static Matrix hat(const Tangent& x) {
    return (Matrix() << 0.0, -x[0], x[1], x[0], 0.0, x[2], 0.0, 0.0, 0.0).finished();
  }
  [[nodiscard]] static Tangent vee(const Matrix& m) {
    return {0.5 * (m(1, 0) - m(0, 1)), m(0, 2), m(1, 2)};
  }

 private:
  SO2 rotation_;
  Point p_ = Point::Zero();
};

static_assert(LieGroup<SE2>);

}  // namespace hamelin::geometry

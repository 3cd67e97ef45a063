#pragma once
#include <Eigen/Core>
#include <cmath>

#include "hamelin/geometry/eigen_alignment.hpp"
#include "hamelin/geometry/lie_group.hpp"

namespace hamelin::geometry {

/// Rotation of the plane, kept as (cos, sin). A value; the default is the identity.
class SO2 {
 public:
  static constexpr int dof = 1;
  using Tangent = Eigen::Matrix<double, 1, 1>;
  using Adjoint = Eigen::Matrix<double, 1, 1>;
  using Point = Eigen::Vector2d;
  using Matrix = Eigen::Matrix2d;

  SO2() = default;
  /// Rotation by an angle [rad], counter-clockwise.
  explicit SO2(double angle) noexcept : cos_(std::cos(angle)), sin_(std::sin(angle)) {}

  [[nodiscard]] double cos() const noexcept { return cos_; }
  [[nodiscard]] double sin() const noexcept { return sin_; }
  /// The angle in (−π, π] [rad].
  [[nodiscard]] double angle() const noexcept { return std::atan2(sin_, cos_); }
  /// 2 × 2 rotation matrix.
  [[nodiscard]] Matrix R() const { return (Matrix() << cos_, -sin_, sin_, cos_).finished(); }
  [[nodiscard]] Matrix matrix() const { return R(); }

  [[nodiscard]] SO2 operator*(const SO2& other) const noexcept {
    return SO2(cos_ * other.cos_ - sin_ * other.sin_, sin_ * other.cos_ + cos_ * other.sin_);
  }
  [[nodiscard]] Point operator*(const Point& point) const { return act(point); }
  [[nodiscard]] Point act(const Point& point) const {
    return {cos_ * point.x() - sin_ * point.y(), sin_ * point.x() + cos_ * point.y()};
  }
  [[nodiscard]] SO2 inverse() const noexcept { return SO2(cos_, -sin_); }
  [[nodiscard]] bool operator==(const SO2&) const = default;

  [[nodiscard]] static SO2 exp(const Tangent& x) { return SO2(x[0]); }
  [[nodiscard]] Tangent log() const { return Tangent(angle()); }

  /// The group commutes: Ad = 1, ad = 0, dexp = 1.
  [[nodiscard]] Adjoint Ad() const { return Adjoint::Identity(); }
  [[nodiscard]] Tangent Ad(const Tangent& x) const { return x; }
  [[nodiscard]] Tangent Ad_T(const Tangent& y) const { return y; }
  [[nodiscard]] static Adjoint ad(const Tangent&) { return Adjoint::Zero(); }
  [[nodiscard]] static Tangent ad(const Tangent&, const Tangent&) { return Tangent::Zero(); }
  [[nodiscard]] static Tangent ad_T(const Tangent&, const Tangent&) { return Tangent::Zero(); }
  [[nodiscard]] static Adjoint dexp(const Tangent&) { return Adjoint::Identity(); }
  [[nodiscard]] static Adjoint dexp_inv(const Tangent&) { return Adjoint::Identity(); }

  [[nodiscard]] static Matrix hat(const Tangent& x) {
    return (Matrix() << 0.0, -x[0], x[0], 0.0).finished();
  }
  [[nodiscard]] static Tangent vee(const Matrix& m) { return Tangent(0.5 * (m(1, 0) - m(0, 1))); }

 private:
  SO2(double cos, double sin) noexcept : cos_(cos), sin_(sin) {}

  double cos_ = 1.0, sin_ = 0.0;
};

static_assert(LieGroup<SO2>);

}  // namespace hamelin::geometry

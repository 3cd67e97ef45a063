#pragma once
#include <Eigen/Core>

#include "hamelin/geometry/eigen_alignment.hpp"
#include "hamelin/geometry/lie_group.hpp"

namespace hamelin::geometry {

/// x̂ with x̂ y = x × y.
[[nodiscard]] Eigen::Matrix3d hat(const Eigen::Vector3d& x);

/// The inverse of hat. A matrix that is not skew-symmetric is replaced by its skew part first.
[[nodiscard]] Eigen::Vector3d vee(const Eigen::Matrix3d& m);

/// Unit quaternion (w, x, y, z) of a rotation matrix, w ≥ 0; accurate at every angle (Shepperd
/// 1978).
[[nodiscard]] Eigen::Vector4d quaternion_wxyz(const Eigen::Matrix3d& R);

/// Rotation matrix of a quaternion (w, x, y, z), which is normalised first.
/// @throws Error invalid unless its norm is 1 to within 1e-6
[[nodiscard]] Eigen::Matrix3d rotation_from_wxyz(const Eigen::Vector4d& wxyz);

/// The least rotation R that turns `from` to the direction of `to`. If they are opposite, the axis
/// is some normal of `from`.
/// @param from,to of any length but 0
[[nodiscard]] Eigen::Matrix3d rotation_between(const Eigen::Vector3d& from,
                                               const Eigen::Vector3d& to);

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
  [[nodiscard]] SO3 inverse() const;
  [[nodiscard]] bool operator==(const SO3& other) const;

  /// 1 + (sin θ/θ) ω̂ + ((1 − cos θ)/θ²) ω̂², docs/theory.md (1.3).
  [[nodiscard]] static SO3 exp(const Tangent& omega);

  /// Below this value n of the half angle's sine, asin(n)/n is 1 to rounding (error n²/6 < 2e-17).
  static constexpr double log_threshold = 1e-8;

  /// The shortest rotation vector, |ω| ≤ π. At exactly π there are two; the one whose largest
  /// component is positive is returned. docs/theory.md (1.12).
  [[nodiscard]] Tangent log() const;

  [[nodiscard]] const Adjoint& Ad() const noexcept { return R_; }
  [[nodiscard]] Tangent Ad(const Tangent& x) const;
  [[nodiscard]] Tangent Ad_T(const Tangent& y) const;
  [[nodiscard]] static Adjoint ad(const Tangent& x);
  [[nodiscard]] static Tangent ad(const Tangent& x, const Tangent& y);
  [[nodiscard]] static Tangent ad_T(const Tangent& x, const Tangent& y);

  /// 1 + a ω̂ + b ω̂², docs/theory.md (1.7).
  [[nodiscard]] static Adjoint dexp(const Tangent& omega);
  /// 1 − ω̂/2 + e ω̂², docs/theory.md (1.8); singular at |ω| = 2π.
  [[nodiscard]] static Adjoint dexp_inv(const Tangent& omega);

  [[nodiscard]] static Matrix hat(const Tangent& x);
  [[nodiscard]] static Tangent vee(const Matrix& m);

 private:
  Matrix R_ = Matrix::Identity();
};

static_assert(LieGroup<SO3>);

}  // namespace hamelin::geometry

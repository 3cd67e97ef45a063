#pragma once
#include <Eigen/Core>

#include "hamelin/geometry/lie_group.hpp"
#include "hamelin/geometry/so3.hpp"

namespace hamelin::geometry {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// Displacement of space. Twists are [ω; v], wrenches [moment; force]. A value; the default is the
/// identity.
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
  [[nodiscard]] Matrix matrix() const;

  [[nodiscard]] SE3 operator*(const SE3& other) const {
    return {R_ * other.R_, R_ * other.p_ + p_};
  }
  [[nodiscard]] Point operator*(const Point& point) const { return R_ * point + p_; }
  [[nodiscard]] Point act(const Point& point) const { return R_ * point + p_; }
  [[nodiscard]] SE3 inverse() const;
  [[nodiscard]] bool operator==(const SE3& other) const;

  /// R = exp ω̂ and p = dexp_ω v (dexp of SO(3)), docs/theory.md (1.4).
  [[nodiscard]] static SE3 exp(const Tangent& x);
  /// ω = log R, |ω| ≤ π, as SO3::log; v = dexp_ω⁻¹ p. docs/theory.md (1.12).
  [[nodiscard]] Tangent log() const;

  /// [R 0; p̂R R], docs/theory.md (1.1): takes a twist from the moved frame to the frame in which
  /// the pose is given.
  [[nodiscard]] Adjoint Ad() const;
  /// Ad() x without the matrix.
  [[nodiscard]] Tangent Ad(const Tangent& x) const;
  /// Ad()ᵀ y: takes a wrench in the opposite direction; y · Ad x = Adᵀy · x [W].
  [[nodiscard]] Tangent Ad_T(const Tangent& y) const;
  /// [ω̂ 0; v̂ ω̂], docs/theory.md (1.2): ad(x) y is the bracket [x, y].
  [[nodiscard]] static Adjoint ad(const Tangent& x);
  /// ad(x) y without the matrix.
  [[nodiscard]] static Tangent ad(const Tangent& x, const Tangent& y);
  /// ad(x)ᵀ y.
  [[nodiscard]] static Tangent ad_T(const Tangent& x, const Tangent& y);

  /// [J 0; Q J] with J = dexp_ω of SO(3) and Q its derivative along v. Twists are rotation vectors
  /// over the dual numbers, ω + εv with ε² = 0, so
  /// Q = a v̂ + b(ω̂v̂ + v̂ω̂) + (ω·v)(a'/θ ω̂ + b'/θ ω̂²). docs/theory.md (1.9).
  [[nodiscard]] static Adjoint dexp(const Tangent& x);
  /// [J⁻¹ 0; Q' J⁻¹] with Q' = −v̂/2 + e(ω̂v̂ + v̂ω̂) + (ω·v) e'/θ ω̂²; singular at |ω| = 2π.
  /// docs/theory.md (1.10).
  [[nodiscard]] static Adjoint dexp_inv(const Tangent& x);

  [[nodiscard]] static Matrix hat(const Tangent& x);
  [[nodiscard]] static Tangent vee(const Matrix& m);

 private:
  Eigen::Matrix3d R_ = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p_ = Eigen::Vector3d::Zero();
};

static_assert(LieGroup<SE3>);

}  // namespace hamelin::geometry

#pragma once
#include <cmath>

#include "hamelin/dynamics/kernel/lanes.hpp"
#include "hamelin/geometry/small.hpp"
#include "hamelin/model/chain.hpp"

namespace hamelin::dynamics::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

using geometry::Mat3;
using geometry::Sym3;
using geometry::Vec3;

/// Twists [w; v] and wrenches [t; f] of SE(3), their changes between a link's joint-aligned frame
/// and its parent's, and the joint's axis.
template <class S, bool Mixed>
struct SpatialVectors {
  using Scalar = S;
  static constexpr bool has_prismatic_or_rotor = Mixed;
  using Link = model::SpatialLink;

  struct Motion {
    Vec3<S> w, v;
  };
  struct Force {
    Vec3<S> t, f;
  };
  /// The pose of a link's frame in its parent's: sine and cosine of the joint's angle, and the
  /// origin.
  struct Placement {
    S s, c;
    Vec3<S> p;
  };

  HAMELIN_INLINE static Vec3<S> vec(const Vec3<double>& a) noexcept {
    return {S(a.x), S(a.y), S(a.z)};
  }
  HAMELIN_INLINE static Motion sum(const Motion& a, const Motion& b) noexcept {
    return {a.w + b.w, a.v + b.v};
  }
  HAMELIN_INLINE static Force sum(const Force& a, const Force& b) noexcept {
    return {a.t + b.t, a.f + b.f};
  }
  HAMELIN_INLINE static Motion scaled(const Motion& a, S k) noexcept { return {a.w * k, a.v * k}; }
  HAMELIN_INLINE static Force scaled(const Force& a, S k) noexcept { return {a.t * k, a.f * k}; }
  HAMELIN_INLINE static Motion zero_motion() noexcept { return {vec({0, 0, 0}), vec({0, 0, 0})}; }
  HAMELIN_INLINE static Force zero_force() noexcept { return {vec({0, 0, 0}), vec({0, 0, 0})}; }

  HAMELIN_INLINE static bool is_prismatic(const Link& l) noexcept { return Mixed && l.prismatic; }
  /// The vector from the parent's origin to the child's, in the parent's axes.
  HAMELIN_INLINE static Vec3<S> offset(const Link& l, const Placement& x) noexcept {
    if constexpr (Mixed)
      return x.p;
    else
      return vec(l.p0);
  }
  /// The angle whose sine and cosine place() takes.
  HAMELIN_INLINE static S angle(const Link& l, S q) noexcept {
    return is_prismatic(l) ? S(l.offset) : q + l.offset;
  }
  HAMELIN_INLINE static void place(const Link& l, S q, S sine, S cosine, Placement& x) noexcept {
    x.s = sine;
    x.c = cosine;
    if constexpr (Mixed) {
      x.p = vec(l.p0);
      if (l.prismatic) {
        x.p.y -= q * l.sin_alpha;
        x.p.z += q * l.cos_alpha;
      }
    }
  }
  HAMELIN_INLINE static Placement place(const Link& l, double q) noexcept {
    Placement x;
    place(l, q, std::sin(angle(l, q)), std::cos(angle(l, q)), x);
    return x;
  }

  HAMELIN_INLINE static Vec3<S> to_child(const Link& l, const Placement& x,
                                         const Vec3<S>& a) noexcept {
    const S y = a.y * l.cos_alpha + a.z * l.sin_alpha, z = a.z * l.cos_alpha - a.y * l.sin_alpha;
    return {a.x * x.c + y * x.s, y * x.c - a.x * x.s, z};
  }
  HAMELIN_INLINE static Vec3<S> to_parent(const Link& l, const Placement& x,
                                          const Vec3<S>& a) noexcept {
    const S u = a.x * x.c - a.y * x.s, y = a.x * x.s + a.y * x.c;
    return {u, y * l.cos_alpha - a.z * l.sin_alpha, y * l.sin_alpha + a.z * l.cos_alpha};
  }
  /// Ad(g⁻¹) of a twist, g the child's pose in the parent.
  HAMELIN_INLINE static Motion to_child(const Link& l, const Placement& x,
                                        const Motion& m) noexcept {
    return {to_child(l, x, m.w), to_child(l, x, m.v + cross(m.w, offset(l, x)))};
  }
  /// Adᵀ(g⁻¹) of a wrench.
  HAMELIN_INLINE static Force to_parent(const Link& l, const Placement& x,
                                        const Force& f) noexcept {
    const Vec3<S> force = to_parent(l, x, f.f);
    return {to_parent(l, x, f.t) + cross(offset(l, x), force), force};
  }
  /// R a Rᵀ with R = Rx(α) Rz(angle).
  template <class T>
  HAMELIN_INLINE static Mat3<T> rotated(const Link& l, const Placement& x,
                                        const Mat3<T>& a) noexcept {
    const T s(x.s), c(x.c), sa(l.sin_alpha), ca(l.cos_alpha);
    const auto turn = [&](const Vec3<T>& v) -> Vec3<T> {
      const T y = v.x * s + v.y * c;
      return {v.x * c - v.y * s, y * ca - v.z * sa, y * sa + v.z * ca};
    };
    const Mat3<T> columns = transpose(Mat3<T>{turn(a.x), turn(a.y), turn(a.z)});
    return transpose(Mat3<T>{turn(columns.x), turn(columns.y), turn(columns.z)});
  }
  HAMELIN_INLINE static Sym3<S> rotated(const Link& l, const Placement& x,
                                        const Sym3<S>& a) noexcept {
    // About z by the joint's angle, then about x by α; the differences keep rounding errors small.
    const S dz = a.xx - a.yy, cs = x.c * x.s, ss = x.s * x.s, kz = dz * ss + S(2) * a.xy * cs;
    const Sym3<S> b{a.xx - kz,
                    dz * cs + a.xy * (S(1) - S(2) * ss),
                    x.c * a.xz - x.s * a.yz,
                    a.yy + kz,
                    x.s * a.xz + x.c * a.yz,
                    a.zz};
    const S ca = l.cos_alpha, sa = l.sin_alpha;
    const S dx = b.yy - b.zz, cas = ca * sa, sas = sa * sa, kx = dx * sas + S(2) * b.yz * cas;
    return {b.xx,
            ca * b.xy - sa * b.xz,
            sa * b.xy + ca * b.xz,
            b.yy - kx,
            dx * cas + b.yz * (S(1) - S(2) * sas),
            b.zz + kx};
  }

  /// The joint's screw A in the link's frame.
  HAMELIN_INLINE static Motion axis(const Link& l) noexcept {
    Motion m = zero_motion();
    (is_prismatic(l) ? m.v.z : m.w.z) = S(1);
    return m;
  }
  /// A · f: the torque (or force) of a wrench about (or along) the joint's axis.
  HAMELIN_INLINE static S along_axis(const Link& l, const Force& f) noexcept {
    return is_prismatic(l) ? f.f.z : f.t.z;
  }
  /// m + A k.
  HAMELIN_INLINE static void add_along_axis(const Link& l, Motion& m, S k) noexcept {
    (is_prismatic(l) ? m.v.z : m.w.z) += k;
  }

  /// adᵀ(x) f.
  HAMELIN_INLINE static Force ad_T(const Motion& x, const Force& f) noexcept {
    return {cross(f.t, x.w) + cross(f.f, x.v), cross(f.f, x.w)};
  }
  HAMELIN_INLINE static S pair(const Motion& m, const Force& f) noexcept {
    return dot(m.w, f.t) + dot(m.v, f.f);
  }
  /// ad(X) A. Its part along the axis is zero and left out.
  HAMELIN_INLINE static Motion bracket(const Link& l, const Motion& X) noexcept {
    const S o = S(0.0);
    if (is_prismatic(l)) return {{o, o, o}, {X.w.y, -X.w.x, o}};
    return {{X.w.y, -X.w.x, o}, {X.v.y, -X.v.x, o}};
  }
  /// adᵀ(A) f.
  HAMELIN_INLINE static Force ad_transposed_axis(const Link& l, const Force& f) noexcept {
    const S o = S(0.0);
    if (is_prismatic(l)) return {{f.f.y, -f.f.x, o}, {o, o, o}};
    return {{f.t.y, -f.t.x, o}, {f.f.y, -f.f.x, o}};
  }
  /// λ · ad(X) A for a twist X and a momentum λ, the first term of docs/theory.md (2.17). The part
  /// of X along A has no effect.
  HAMELIN_INLINE static S coriolis_torque(const Link& l, const Motion& X,
                                          const Force& lambda) noexcept {
    if (is_prismatic(l)) return lambda.f.x * X.w.y - lambda.f.y * X.w.x;
    return lambda.t.x * X.w.y - lambda.t.y * X.w.x + lambda.f.x * X.v.y - lambda.f.y * X.v.x;
  }

  /// A gyroscopic coefficient w, its change to the child's axes, and the wrench (p × f, f) of the
  /// force f = w × (velocity of point p).
  HAMELIN_INLINE static Vec3<S> spin_axis(const Vec3<double>& w) noexcept { return vec(w); }
  HAMELIN_INLINE static Vec3<S> to_child_axis(const Link& l, const Placement& x,
                                              const Vec3<S>& w) noexcept {
    return to_child(l, x, w);
  }
  HAMELIN_INLINE static Force spin_force(const Vec3<S>& w, const Placement&,
                                         const Vec3<double>& point, const Motion& m) noexcept {
    const Vec3<S> p = vec(point), f = cross(w, m.v + cross(m.w, p));
    return {cross(p, f), f};
  }
};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::dynamics::kernel

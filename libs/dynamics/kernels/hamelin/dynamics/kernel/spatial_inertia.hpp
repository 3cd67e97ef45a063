#pragma once
#include "hamelin/dynamics/kernel/spatial_vectors.hpp"
#include "hamelin/geometry/small.hpp"

namespace hamelin::dynamics::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

/// Articulated inertias and first moments of SE(3).
template <class S, bool Mixed>
struct SpatialInertia : SpatialVectors<S, Mixed> {
  using Base = SpatialVectors<S, Mixed>;
  using Base::is_prismatic;
  using Base::offset;
  using Base::rotated;
  using Base::to_parent;
  using Base::vec;
  using typename Base::Force;
  using typename Base::Link;
  using typename Base::Motion;
  using typename Base::Placement;

  /// Symmetric (articulated) inertia:  t = A w + H v,  f = Hᵀ w + M v.
  struct Inertia {
    Sym3<S> A, M;
    Mat3<S> H;
  };
  /// Mass and first moment of a link and all links outboard of it.
  struct Moment {
    S m;
    Vec3<S> h;
  };

  HAMELIN_INLINE static Sym3<S> inertia(const Link& l) noexcept {
    return {S(l.inertia.xx), S(l.inertia.xy), S(l.inertia.xz),
            S(l.inertia.yy), S(l.inertia.yz), S(l.inertia.zz)};
  }
  HAMELIN_INLINE static Inertia rigid(const Link& l) noexcept {
    const S o = S(0), m = S(l.mass);
    const Vec3<S> h = vec(l.moment);
    return {inertia(l), {m, o, o, m, o, m}, {{o, -h.z, h.y}, {h.z, o, -h.x}, {-h.y, h.x, o}}};
  }
  HAMELIN_INLINE static Inertia no_inertia() noexcept {
    const S o = S(0);
    const Vec3<S> z{o, o, o};
    return {{o, o, o, o, o, o}, {o, o, o, o, o, o}, {z, z, z}};
  }
  /// P += rigid(l), without the entries that are zero.
  HAMELIN_INLINE static void add_rigid(const Link& l, const Placement&, Inertia& P) noexcept {
    P.A = P.A + inertia(l);
    P.M.xx += S(l.mass);
    P.M.yy += S(l.mass);
    P.M.zz += S(l.mass);
    P.H.x.y -= S(l.moment.z);
    P.H.x.z += S(l.moment.y);
    P.H.y.x += S(l.moment.z);
    P.H.y.z -= S(l.moment.x);
    P.H.z.x -= S(l.moment.y);
    P.H.z.y += S(l.moment.x);
  }
  HAMELIN_INLINE static Moment moment(const Link& l, const Placement&) noexcept {
    return {S(l.mass), vec(l.moment)};
  }
  HAMELIN_INLINE static Moment no_moment() noexcept { return {S(0), vec({0, 0, 0})}; }

  HAMELIN_INLINE static Force times(const Inertia& P, const Motion& m) noexcept {
    return {P.A * m.w + P.H * m.v, geometry::transposed_times(P.H, m.w) + P.M * m.v};
  }
  /// P − k u uᵀ.
  HAMELIN_INLINE static void subtract_outer(Inertia& P, const Force& u, S k) noexcept {
    const Force ku{u.t * k, u.f * k};
    P.A = minus_outer(P.A, u.t, k);
    P.M = minus_outer(P.M, u.f, k);
    P.H = minus_outer(P.H, ku.t, u.f);
  }
  HAMELIN_INLINE static void add(Inertia& P, const Inertia& Q) noexcept {
    P = {P.A + Q.A, P.M + Q.M, P.H + Q.H};
  }
  HAMELIN_INLINE static void add(Moment& k, const Moment& j) noexcept {
    k = {k.m + j.m, k.h + j.h};
  }

  HAMELIN_INLINE static Force momentum(const Link& l, const Placement&, const Motion& m) noexcept {
    return momentum(l, m);
  }
  /// I ξ of one link, docs/theory.md (2.2).
  HAMELIN_INLINE static Force momentum(const Link& l, const Motion& m) noexcept {
    const Vec3<S> h = vec(l.moment);
    return {inertia(l) * m.w + cross(h, m.v), m.v * S(l.mass) - cross(h, m.w)};
  }

  /// P A.
  HAMELIN_INLINE static Force column(const Link& l, const Inertia& P) noexcept {
    if (is_prismatic(l)) return {{P.H.x.z, P.H.y.z, P.H.z.z}, {P.M.xz, P.M.yz, P.M.zz}};
    return {{P.A.xz, P.A.yz, P.A.zz}, P.H.z};
  }
  /// A · P A.
  HAMELIN_INLINE static S pivot(const Link& l, const Inertia& P) noexcept {
    return is_prismatic(l) ? P.M.zz : P.A.zz;
  }

  /// P about an origin displaced by −p.
  HAMELIN_INLINE static void shift(const Vec3<S>& p, Inertia& P) noexcept {
    const Mat3<S> right = times_hat(P.H, p);
    P.H = P.H + hat_times(p, full(P.M));
    const Mat3<S> left = hat_times(p, transpose(P.H));
    P.A.xx += left.x.x - right.x.x;
    P.A.xy += left.x.y - right.x.y;
    P.A.xz += left.x.z - right.x.z;
    P.A.yy += left.y.y - right.y.y;
    P.A.yz += left.y.z - right.y.z;
    P.A.zz += left.z.z - right.z.z;
  }
  /// Adᵀ(g⁻¹) P Ad(g⁻¹).
  HAMELIN_INLINE static Inertia to_parent(const Link& l, const Placement& x,
                                          const Inertia& P) noexcept {
    Inertia out{rotated(l, x, P.A), rotated(l, x, P.M), rotated(l, x, P.H)};
    shift(offset(l, x), out);
    return out;
  }
  /// P ← Adᵀ(g⁻¹) (P − u uᵀ/d) Ad(g⁻¹) with u = P A, k = u/d: an articulated body as its parent
  /// sees it through the joint, docs/theory.md (2.12). Inboard of a revolute joint without rotor
  /// inertia all moments about z vanish: the third row and column of A and the third row of H are
  /// zero.
  HAMELIN_INLINE static void carry(const Link& l, const Placement& x, Inertia& P, const Force& k,
                                   S inv_d) noexcept {
    const Force u = column(l, P);
    if (Mixed && (l.prismatic || l.armature != 0.0)) {
      subtract_outer(P, u, inv_d);
      P.A = rotated(l, x, P.A);
      P.M = rotated(l, x, P.M);
      P.H = rotated(l, x, P.H);
    } else {
      const S ca = S(l.cos_alpha), sa = S(l.sin_alpha);
      const S xx = P.A.xx - k.t.x * u.t.x, xy = P.A.xy - k.t.x * u.t.y, yy = P.A.yy - k.t.y * u.t.y;
      const S d = xx - yy, cs = x.c * x.s, ss = x.s * x.s, turn = d * ss + S(2.0) * xy * cs;
      const S turned = d * cs + xy * (S(1.0) - S(2.0) * ss), rest = yy + turn;
      P.A = {xx - turn,        turned * ca,      turned * sa,
             rest * (ca * ca), rest * (ca * sa), rest * (sa * sa)};
      const Vec3<S> f = u.f, kf = k.f;
      P.M = rotated(l, x,
                    Sym3<S>{P.M.xx - kf.x * f.x, P.M.xy - kf.x * f.y, P.M.xz - kf.x * f.z,
                            P.M.yy - kf.y * f.y, P.M.yz - kf.y * f.z, P.M.zz - kf.z * f.z});
      const Vec3<S> hx = P.H.x - f * k.t.x, hy = P.H.y - f * k.t.y;
      P.H.x = to_parent(l, x, hx * x.c - hy * x.s);
      const Vec3<S> row = to_parent(l, x, hx * x.s + hy * x.c);
      P.H.y = row * ca;
      P.H.z = row * sa;
    }
    shift(offset(l, x), P);
  }
  HAMELIN_INLINE static Moment to_parent(const Link& l, const Placement& x,
                                         const Moment& k) noexcept {
    return {k.m, to_parent(l, x, k.h) + offset(l, x) * k.m};
  }
};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::dynamics::kernel

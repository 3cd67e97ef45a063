#pragma once
#include <cmath>
#include <type_traits>

#include "hamelin/dynamics/kernel/lanes.hpp"
#include "hamelin/geometry/small.hpp"
#include "hamelin/model/chain.hpp"

namespace hamelin::dynamics::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

using geometry::Mat3;
using geometry::Sym3;
using geometry::Vec3;

/// The operations of the sweeps in SE(3): twists [w; v], wrenches [t; f], articulated inertias, and
/// their changes between a link's joint-aligned frame and its parent's. kernel/planar.hpp has the
/// same names for SE(2). S is the scalar, double or Lanes. `Mixed` chains may have prismatic joints
/// and rotor inertias; otherwise the code for them is left out.
template <class S, bool Mixed = true>
struct Spatial {
  using Scalar = S;
  static constexpr bool has_prismatic_or_rotor = Mixed;
  static constexpr bool root_axes = false;  ///< each frame rotates with its link
  using Link = model::SpatialLink;
  using Chain = model::SpatialChain;

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
  /// Symmetric (articulated) inertia:  t = A w + H v,  f = Hᵀ w + M v.
  struct Inertia {
    Sym3<S> A, M;
    Mat3<S> H;
  };
  /// A general operator from twists to wrenches:  t = A w + B v,  f = C w + D v.
  struct Blocks {
    Mat3<S> A, B, C, D;
  };
  /// The same operator with its four blocks in the lanes A, B, C, D of registers, one register per
  /// entry. A rotation acts on all four blocks alike.
  struct PackedBlocks {
    Mat3<Lanes<4>> m;
  };
  static constexpr bool packs = std::is_same_v<S, double> && native_lanes >= 4;
  using Operator = std::conditional_t<packs, PackedBlocks, Blocks>;
  /// The state that Newton–Euler passes outwards: angular velocity w, angular acceleration dw,
  /// acceleration a of the frame's origin, and turn = Ω = hat(dw) + hat(w)², with which a point r
  /// accelerates as a + Ω r, docs/theory.md (2.10).
  struct Flow {
    Vec3<S> w, dw, a;
    Mat3<S> turn;
  };
  /// Mass and first moment of a link and all links outboard of it.
  struct Moment {
    S m;
    Vec3<S> h;
  };

  HAMELIN_INLINE static bool is_prismatic(const Link& l) noexcept { return Mixed && l.prismatic; }
  /// The vector from the parent's origin to the child's, in the parent's axes.
  HAMELIN_INLINE static Vec3<S> offset(const Link& l, const Placement& x) noexcept {
    if constexpr (Mixed)
      return x.p;
    else
      return vec(l.p0);
  }

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
  HAMELIN_INLINE static Flow root_flow(const Chain& chain) noexcept {
    const Vec3<S> o = vec({0, 0, 0});
    return {o, o, vec({-chain.gravity.x, -chain.gravity.y, -chain.gravity.z}), {o, o, o}};
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
  /// P A.
  HAMELIN_INLINE static Force column(const Link& l, const Inertia& P) noexcept {
    if (is_prismatic(l)) return {{P.H.x.z, P.H.y.z, P.H.z.z}, {P.M.xz, P.M.yz, P.M.zz}};
    return {{P.A.xz, P.A.yz, P.A.zz}, P.H.z};
  }

  /// A · P A.
  HAMELIN_INLINE static S pivot(const Link& l, const Inertia& P) noexcept {
    return is_prismatic(l) ? P.M.zz : P.A.zz;
  }

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
  HAMELIN_INLINE static Force momentum(const Link& l, const Placement&, const Motion& m) noexcept {
    return momentum(l, m);
  }
  /// I ξ of one link, docs/theory.md (2.2).
  HAMELIN_INLINE static Force momentum(const Link& l, const Motion& m) noexcept {
    const Vec3<S> h = vec(l.moment);
    return {inertia(l) * m.w + cross(h, m.v), m.v * S(l.mass) - cross(h, m.w)};
  }

  HAMELIN_INLINE static Force times(const Inertia& P, const Motion& m) noexcept {
    return {P.A * m.w + P.H * m.v, geometry::transposed_times(P.H, m.w) + P.M * m.v};
  }
  HAMELIN_INLINE static Force times(const Blocks& P, const Motion& m) noexcept {
    return {P.A * m.w + P.B * m.v, P.C * m.w + P.D * m.v};
  }
  HAMELIN_INLINE static Force transposed_times(const Blocks& P, const Motion& m) noexcept {
    return {geometry::transposed_times(P.A, m.w) + geometry::transposed_times(P.C, m.v),
            geometry::transposed_times(P.B, m.w) + geometry::transposed_times(P.D, m.v)};
  }
  /// P − k u uᵀ.
  HAMELIN_INLINE static void subtract_outer(Inertia& P, const Force& u, S k) noexcept {
    const Force ku{u.t * k, u.f * k};
    P.A = minus_outer(P.A, u.t, k);
    P.M = minus_outer(P.M, u.f, k);
    P.H = minus_outer(P.H, ku.t, u.f);
  }
  /// P − u wᵀ.
  HAMELIN_INLINE static void subtract_outer(Blocks& P, const Force& u, const Force& w) noexcept {
    P = {minus_outer(P.A, u.t, w.t), minus_outer(P.B, u.t, w.f), minus_outer(P.C, u.f, w.t),
         minus_outer(P.D, u.f, w.f)};
  }
  HAMELIN_INLINE static void subtract_outer(PackedBlocks& P, const Force& u,
                                            const Force& w) noexcept {
    P.m = minus_outer(P.m, {pairwise(u.t.x, u.f.x), pairwise(u.t.y, u.f.y), pairwise(u.t.z, u.f.z)},
                      {alternate(w.t.x, w.f.x), alternate(w.t.y, w.f.y), alternate(w.t.z, w.f.z)});
  }
  HAMELIN_INLINE static void add(Inertia& P, const Inertia& Q) noexcept {
    P = {P.A + Q.A, P.M + Q.M, P.H + Q.H};
  }
  HAMELIN_INLINE static void add(Blocks& P, const Blocks& Q) noexcept {
    P = {P.A + Q.A, P.B + Q.B, P.C + Q.C, P.D + Q.D};
  }
  HAMELIN_INLINE static void add(PackedBlocks& P, const Blocks& Q) noexcept {
    const auto row = [](const Vec3<S>& a, const Vec3<S>& b, const Vec3<S>& c,
                        const Vec3<S>& d) -> Vec3<Lanes<4>> {
      using Real = typename Lanes<4>::Real;
      return {Real{a.x, b.x, c.x, d.x}, Real{a.y, b.y, c.y, d.y}, Real{a.z, b.z, c.z, d.z}};
    };
    P.m = P.m + Mat3<Lanes<4>>{row(Q.A.x, Q.B.x, Q.C.x, Q.D.x), row(Q.A.y, Q.B.y, Q.C.y, Q.D.y),
                               row(Q.A.z, Q.B.z, Q.C.z, Q.D.z)};
  }
  HAMELIN_INLINE static void add(Moment& k, const Moment& j) noexcept {
    k = {k.m + j.m, k.h + j.h};
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
  /// P (A + b) and, in the next function, Pᵀ (A − b), for a bracket b, whose components along z are
  /// zero.
  HAMELIN_INLINE static Force times_axis_plus(const Link& l, const Blocks& P,
                                              const Motion& b) noexcept {
    const auto part = [](const Vec3<S>& row, const Vec3<S>& x) {
      return row.x * x.x + row.y * x.y;
    };
    const Force turned{{part(P.A.x, b.w) + part(P.B.x, b.v), part(P.A.y, b.w) + part(P.B.y, b.v),
                        part(P.A.z, b.w) + part(P.B.z, b.v)},
                       {part(P.C.x, b.w) + part(P.D.x, b.v), part(P.C.y, b.w) + part(P.D.y, b.v),
                        part(P.C.z, b.w) + part(P.D.z, b.v)}};
    if (is_prismatic(l))
      return sum({{P.B.x.z, P.B.y.z, P.B.z.z}, {P.D.x.z, P.D.y.z, P.D.z.z}}, turned);
    return sum({{P.A.x.z, P.A.y.z, P.A.z.z}, {P.C.x.z, P.C.y.z, P.C.z.z}}, turned);
  }
  HAMELIN_INLINE static Force transposed_times_axis_minus(const Link& l, const Blocks& P,
                                                          const Motion& b) noexcept {
    const Force turned{P.A.x * b.w.x + P.A.y * b.w.y + P.C.x * b.v.x + P.C.y * b.v.y,
                       P.B.x * b.w.x + P.B.y * b.w.y + P.D.x * b.v.x + P.D.y * b.v.y};
    const Force row = is_prismatic(l) ? Force{P.C.z, P.D.z} : Force{P.A.z, P.B.z};
    return {row.t - turned.t, row.f - turned.f};
  }
  HAMELIN_INLINE static Force times_axis_plus(const Link& l, const PackedBlocks& P,
                                              const Motion& b) noexcept {
    const S one(1.0), o(0.0);
    const Vec3<Lanes<4>> x{alternate(b.w.x, b.v.x), alternate(b.w.y, b.v.y),
                           is_prismatic(l) ? alternate(o, one) : alternate(one, o)};
    const Lanes<4> a = dot(P.m.x, x), c = dot(P.m.y, x), d = dot(P.m.z, x);
    return {{a[0] + a[1], c[0] + c[1], d[0] + d[1]}, {a[2] + a[3], c[2] + c[3], d[2] + d[3]}};
  }
  HAMELIN_INLINE static Force transposed_times_axis_minus(const Link& l, const PackedBlocks& P,
                                                          const Motion& b) noexcept {
    const S one(1.0), o(0.0);
    const Vec3<Lanes<4>> sum = P.m.x * pairwise(-b.w.x, -b.v.x) + P.m.y * pairwise(-b.w.y, -b.v.y) +
                               P.m.z * (is_prismatic(l) ? pairwise(o, one) : pairwise(one, o));
    return {{sum.x[0] + sum.x[2], sum.y[0] + sum.y[2], sum.z[0] + sum.z[2]},
            {sum.x[1] + sum.x[3], sum.y[1] + sum.y[3], sum.z[1] + sum.z[3]}};
  }
  /// Pᵀ A.
  HAMELIN_INLINE static Force row(const Link& l, const Blocks& P) noexcept {
    return is_prismatic(l) ? Force{P.C.z, P.D.z} : Force{P.A.z, P.B.z};
  }
  HAMELIN_INLINE static Force row(const Link& l, const PackedBlocks& P) noexcept {
    const Vec3<Lanes<4>>& z = P.m.z;
    if (is_prismatic(l)) return {{z.x[2], z.y[2], z.z[2]}, {z.x[3], z.y[3], z.z[3]}};
    return {{z.x[0], z.y[0], z.z[0]}, {z.x[1], z.y[1], z.z[1]}};
  }
  /// (a, b, a, b) and (a, a, b, b).
  HAMELIN_INLINE static Lanes<4> alternate(double a, double b) noexcept {
    return typename Lanes<4>::Real{a, b, a, b};
  }
  HAMELIN_INLINE static Lanes<4> pairwise(double a, double b) noexcept {
    return typename Lanes<4>::Real{a, a, b, b};
  }

  HAMELIN_INLINE static Operator no_operator() noexcept {
    if constexpr (packs) {
      const Vec3<Lanes<4>> z{Lanes<4>(0.0), Lanes<4>(0.0), Lanes<4>(0.0)};
      return {{z, z, z}};
    } else {
      const Vec3<S> z{S(0.0), S(0.0), S(0.0)};
      const Mat3<S> none{z, z, z};
      return {none, none, none, none};
    }
  }
  HAMELIN_INLINE static void add_rigid(const Link& l, const Placement&, Blocks& P) noexcept {
    P.A = P.A + full(inertia(l));
    P.D.x.x += S(l.mass);
    P.D.y.y += S(l.mass);
    P.D.z.z += S(l.mass);
    P.B.x.y -= S(l.moment.z);
    P.B.x.z += S(l.moment.y);
    P.B.y.x += S(l.moment.z);
    P.B.y.z -= S(l.moment.x);
    P.B.z.x -= S(l.moment.y);
    P.B.z.y += S(l.moment.x);
    P.C.x.y += S(l.moment.z);
    P.C.x.z -= S(l.moment.y);
    P.C.y.x -= S(l.moment.z);
    P.C.y.z += S(l.moment.x);
    P.C.z.x += S(l.moment.y);
    P.C.z.y -= S(l.moment.x);
  }
  HAMELIN_INLINE static void add_rigid(const Link& l, const Placement&, PackedBlocks& P) noexcept {
    using Real = typename Lanes<4>::Real;
    const auto& I = l.inertia;
    const auto& h = l.moment;
    P.m.x.x += Real{I.xx, 0.0, 0.0, l.mass};
    P.m.x.y += Real{I.xy, -h.z, h.z, 0.0};
    P.m.x.z += Real{I.xz, h.y, -h.y, 0.0};
    P.m.y.x += Real{I.xy, h.z, -h.z, 0.0};
    P.m.y.y += Real{I.yy, 0.0, 0.0, l.mass};
    P.m.y.z += Real{I.yz, -h.x, h.x, 0.0};
    P.m.z.x += Real{I.xz, -h.y, h.y, 0.0};
    P.m.z.y += Real{I.yz, h.x, -h.x, 0.0};
    P.m.z.z += Real{I.zz, 0.0, 0.0, l.mass};
  }
  /// P ← Adᵀ(g⁻¹) P Ad(g⁻¹).
  HAMELIN_INLINE static void carry(const Link& l, const Placement& x, Blocks& P) noexcept {
    const Vec3<S> p = offset(l, x);
    P.A = rotated(l, x, P.A);
    P.B = rotated(l, x, P.B);
    P.C = rotated(l, x, P.C);
    P.D = rotated(l, x, P.D);
    P.A = P.A - times_hat(P.B, p);
    P.B = P.B + hat_times(p, P.D);
    P.C = P.C - times_hat(P.D, p);
    P.A = P.A + hat_times(p, P.C);
  }
  HAMELIN_INLINE static void carry(const Link& l, const Placement& x, PackedBlocks& P) noexcept {
    const Vec3<S> p = offset(l, x);
    const S o(0.0);
    P.m = rotated(l, x, P.m);
    // A −= B p̂, C −= D p̂; then A += p̂ C, B += p̂ D
    P.m = P.m - times_hat(shuffled<1, 1, 3, 3>(P.m),
                          {alternate(p.x, o), alternate(p.y, o), alternate(p.z, o)});
    P.m = P.m + hat_times({pairwise(p.x, o), pairwise(p.y, o), pairwise(p.z, o)},
                          shuffled<2, 3, 2, 3>(P.m));
  }
  template <int i, int j, int k, int n>
  HAMELIN_INLINE static Mat3<Lanes<4>> shuffled(const Mat3<Lanes<4>>& a) noexcept {
    const auto one = [](Lanes<4> v) -> Lanes<4> {
      return __builtin_shufflevector(v.v, v.v, i, j, k, n);
    };
    const auto row = [&](const Vec3<Lanes<4>>& v) -> Vec3<Lanes<4>> {
      return {one(v.x), one(v.y), one(v.z)};
    };
    return {row(a.x), row(a.y), row(a.z)};
  }
  /// The operator G with spin_force(w, point, m) = G m.
  HAMELIN_INLINE static Blocks spin_operator(const Vec3<S>& w, const Placement&,
                                             const Vec3<double>& point) noexcept {
    const S o = S(0.0);
    const Vec3<S> p = vec(point);
    const Mat3<S> D{{o, -w.z, w.y}, {w.z, o, -w.x}, {-w.y, w.x, o}};
    const Mat3<S> none{{o, o, o}, {o, o, o}, {o, o, o}};
    const Mat3<S> C = none - times_hat(D, p);
    return {hat_times(p, C), hat_times(p, D), C, D};
  }

  /// λ · ad(X) A for a twist X and a momentum λ, the first term of docs/theory.md (2.17). The part
  /// of X along A has no effect.
  HAMELIN_INLINE static S coriolis_torque(const Link& l, const Motion& X,
                                          const Force& lambda) noexcept {
    if (is_prismatic(l)) return lambda.f.x * X.w.y - lambda.f.y * X.w.x;
    return lambda.t.x * X.w.y - lambda.t.y * X.w.x + lambda.f.x * X.v.y - lambda.f.y * X.v.x;
  }

  /// Newton–Euler outwards: the parent's flow in the child's frame, plus joint rate v and
  /// acceleration a.
  HAMELIN_INLINE static Flow advance(const Link& l, const Placement& x, const Flow& parent, S v,
                                     S a) noexcept {
    Flow out{to_child(l, x, parent.w),
             to_child(l, x, parent.dw),
             to_child(l, x, parent.a + parent.turn * offset(l, x)),
             {}};
    if (is_prismatic(l)) {
      out.a.x += S(2) * out.w.y * v;
      out.a.y -= S(2) * out.w.x * v;
      out.a.z += a;
    } else {
      out.dw.x += out.w.y * v;
      out.dw.y -= out.w.x * v;
      out.dw.z += a;
      out.w.z += v;
    }
    const Vec3<S>&w = out.w, &dw = out.dw;
    const S xx = w.x * w.x, yy = w.y * w.y, zz = w.z * w.z, xy = w.x * w.y, xz = w.x * w.z,
            yz = w.y * w.z;
    out.turn = {{-(yy + zz), xy - dw.z, xz + dw.y},
                {xy + dw.z, -(xx + zz), yz - dw.x},
                {xz - dw.y, yz + dw.x, -(xx + yy)}};
    return out;
  }
  /// The wrench about the frame's origin that gives the rigid link this motion. Gravity enters
  /// through the root's acceleration.
  HAMELIN_INLINE static Force inertial_force(const Link& l, const Placement&,
                                             const Flow& k) noexcept {
    const Vec3<S> h = vec(l.moment);
    const Sym3<S> I = inertia(l);
    return {I * k.dw + cross(k.w, I * k.w) + cross(h, k.a), k.a * S(l.mass) + k.turn * h};
  }
  /// −g · (first moment), the potential energy of all links relative to the root's origin.
  HAMELIN_INLINE static S potential(const Chain& chain, const Moment& k) noexcept {
    return -dot(vec(chain.gravity), k.h);
  }

  /// A vector that is constant in the world, in the axes of a link's frame.
  using Direction = Vec3<S>;
  HAMELIN_INLINE static Direction gravity(const Chain& chain) noexcept {
    return vec(chain.gravity);
  }
  HAMELIN_INLINE static Moment no_moment() noexcept { return {S(0), vec({0, 0, 0})}; }

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

  /// The torque of gravity on the joint, −∂U/∂q, with gravity g in the link's frame and the
  /// outboard moment k: docs/theory.md (2.7).
  HAMELIN_INLINE static S gravity_torque(const Link& l, const Direction& g,
                                         const Moment& k) noexcept {
    return is_prismatic(l) ? k.m * g.z : k.h.x * g.y - k.h.y * g.x;
  }
};

/// Mixed: with prismatic joints and rotor inertias. Plain: without.
template <class S>
using SpatialMixed = Spatial<S, true>;
template <class S>
using SpatialPlain = Spatial<S, false>;

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::dynamics::kernel

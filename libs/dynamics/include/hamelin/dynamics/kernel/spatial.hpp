#pragma once
#include <cmath>

#include "hamelin/geometry/small.hpp"
#include "hamelin/model/chain.hpp"

namespace hamelin::dynamics::kernel {

using geometry::Mat3;
using geometry::Sym3;
using geometry::Vec3;

/// SE(3) as the sweeps see it: twists [w; v], wrenches [t; f], articulated inertias, and how they pass between a link's
/// joint-aligned frame and its parent's. kernel/planar.hpp has the same names for SE(2). S is the scalar.
template <class S>
struct Spatial {
  using Scalar = S;
  using Link = model::SpatialLink;
  using Chain = model::SpatialChain;

  struct Motion {
    Vec3<S> w, v;
  };
  struct Force {
    Vec3<S> t, f;
  };
  /// Where a link's frame stands in its parent's at some q.
  struct Placement {
    S s, c;
    Vec3<S> p;
  };
  /// Symmetric (articulated) inertia:  t = A w + H v,  f = Hᵀ w + M v.
  struct Inertia {
    Sym3<S> A, M;
    Mat3<S> H;
  };
  /// The same without symmetry:  t = A w + B v,  f = C w + D v.
  struct Operator {
    Mat3<S> A, B, C, D;
  };
  /// What Newton–Euler carries outwards: angular velocity, angular acceleration, acceleration of the frame's origin.
  struct Flow {
    Vec3<S> w, dw, a;
  };
  /// Mass and first moment of everything outboard.
  struct Moment {
    S m;
    Vec3<S> h;
  };

  static Vec3<S> vec(const Vec3<double>& a) noexcept { return {S(a.x), S(a.y), S(a.z)}; }

  static Motion sum(const Motion& a, const Motion& b) noexcept { return {a.w + b.w, a.v + b.v}; }
  static Force sum(const Force& a, const Force& b) noexcept { return {a.t + b.t, a.f + b.f}; }
  static Motion scaled(const Motion& a, S k) noexcept { return {a.w * k, a.v * k}; }
  static Force scaled(const Force& a, S k) noexcept { return {a.t * k, a.f * k}; }

  static Motion zero_motion() noexcept { return {vec({0, 0, 0}), vec({0, 0, 0})}; }
  static Force zero_force() noexcept { return {vec({0, 0, 0}), vec({0, 0, 0})}; }
  static Flow root_flow(const Chain& chain) noexcept {
    return {vec({0, 0, 0}), vec({0, 0, 0}), vec({-chain.gravity.x, -chain.gravity.y, -chain.gravity.z})};
  }

  static Placement place(const Link& l, S q) noexcept {
    const S angle = l.prismatic ? S(l.offset) : q + l.offset;
    Placement x{std::sin(angle), std::cos(angle), vec(l.p0)};
    if (l.prismatic) {
      x.p.y -= q * l.sin_alpha;
      x.p.z += q * l.cos_alpha;
    }
    return x;
  }

  static Vec3<S> to_child(const Link& l, const Placement& x, const Vec3<S>& a) noexcept {
    const S y = a.y * l.cos_alpha + a.z * l.sin_alpha, z = a.z * l.cos_alpha - a.y * l.sin_alpha;
    return {a.x * x.c + y * x.s, y * x.c - a.x * x.s, z};
  }
  static Vec3<S> to_parent(const Link& l, const Placement& x, const Vec3<S>& a) noexcept {
    const S u = a.x * x.c - a.y * x.s, y = a.x * x.s + a.y * x.c;
    return {u, y * l.cos_alpha - a.z * l.sin_alpha, y * l.sin_alpha + a.z * l.cos_alpha};
  }
  /// Ad(g⁻¹) of a twist, g the child's pose in the parent.
  static Motion to_child(const Link& l, const Placement& x, const Motion& m) noexcept {
    return {to_child(l, x, m.w), to_child(l, x, m.v + cross(m.w, x.p))};
  }
  /// Adᵀ(g⁻¹) of a wrench.
  static Force to_parent(const Link& l, const Placement& x, const Force& f) noexcept {
    const Vec3<S> force = to_parent(l, x, f.f);
    return {to_parent(l, x, f.t) + cross(x.p, force), force};
  }
  /// R a Rᵀ with R = Rx(α) Rz(angle).
  static Mat3<S> rotated(const Link& l, const Placement& x, const Mat3<S>& a) noexcept {
    const Mat3<S> rows{to_parent(l, x, a.x), to_parent(l, x, a.y), to_parent(l, x, a.z)};
    const Mat3<S> cols = transpose(rows);
    return transpose(Mat3<S>{to_parent(l, x, cols.x), to_parent(l, x, cols.y), to_parent(l, x, cols.z)});
  }
  static Sym3<S> rotated(const Link& l, const Placement& x, const Sym3<S>& a) noexcept {
    // about z by the joint's angle, then about x by α; written with differences so that rounding stays small
    const S dz = a.xx - a.yy, cs = x.c * x.s, ss = x.s * x.s, kz = dz * ss + S(2) * a.xy * cs;
    const Sym3<S> b{
        a.xx - kz, dz * cs + a.xy * (S(1) - S(2) * ss), x.c * a.xz - x.s * a.yz, a.yy + kz, x.s * a.xz + x.c * a.yz,
        a.zz};
    const S ca = l.cos_alpha, sa = l.sin_alpha;
    const S dx = b.yy - b.zz, cas = ca * sa, sas = sa * sa, kx = dx * sas + S(2) * b.yz * cas;
    return {b.xx,     ca * b.xy - sa * b.xz, sa * b.xy + ca * b.xz, b.yy - kx, dx * cas + b.yz * (S(1) - S(2) * sas),
            b.zz + kx};
  }
  /// Adᵀ(g⁻¹) P Ad(g⁻¹).
  static Inertia to_parent(const Link& l, const Placement& x, const Inertia& P) noexcept {
    Inertia out{rotated(l, x, P.A), rotated(l, x, P.M), rotated(l, x, P.H)};
    const Mat3<S> H = out.H;
    out.H = H + hat_times(x.p, full(out.M));
    const Mat3<S> right = times_hat(H, x.p), left = hat_times(x.p, transpose(out.H));
    out.A.xx += left.x.x - right.x.x;
    out.A.xy += left.x.y - right.x.y;
    out.A.xz += left.x.z - right.x.z;
    out.A.yy += left.y.y - right.y.y;
    out.A.yz += left.y.z - right.y.z;
    out.A.zz += left.z.z - right.z.z;
    return out;
  }
  static Operator to_parent(const Link& l, const Placement& x, const Operator& P) noexcept {
    const Mat3<S> A = rotated(l, x, P.A), B = rotated(l, x, P.B), C = rotated(l, x, P.C), D = rotated(l, x, P.D);
    const Mat3<S> shifted = C - times_hat(D, x.p);
    return {A - times_hat(B, x.p) + hat_times(x.p, shifted), B + hat_times(x.p, D), shifted, D};
  }
  static Moment to_parent(const Link& l, const Placement& x, const Moment& k) noexcept {
    return {k.m, to_parent(l, x, k.h) + x.p * k.m};
  }

  /// The joint's screw A in the link's frame.
  static Motion axis(const Link& l) noexcept {
    Motion m = zero_motion();
    (l.prismatic ? m.v.z : m.w.z) = S(1);
    return m;
  }
  /// A · f: what the joint feels of a wrench.
  static S along_axis(const Link& l, const Force& f) noexcept { return l.prismatic ? f.f.z : f.t.z; }
  /// m + A k.
  static void add_along_axis(const Link& l, Motion& m, S k) noexcept { (l.prismatic ? m.v.z : m.w.z) += k; }
  /// P A.
  static Force column(const Link& l, const Inertia& P) noexcept {
    if (l.prismatic) return {{P.H.x.z, P.H.y.z, P.H.z.z}, {P.M.xz, P.M.yz, P.M.zz}};
    return {{P.A.xz, P.A.yz, P.A.zz}, P.H.z};
  }

  static Inertia rigid(const Link& l) noexcept {
    const S o = S(0), m = S(l.mass);
    const Vec3<S> h = vec(l.moment);
    return {{S(l.inertia.xx), S(l.inertia.xy), S(l.inertia.xz), S(l.inertia.yy), S(l.inertia.yz), S(l.inertia.zz)},
            {m, o, o, m, o, m},
            {{o, -h.z, h.y}, {h.z, o, -h.x}, {-h.y, h.x, o}}};
  }
  static Operator general(const Inertia& P) noexcept { return {full(P.A), P.H, transpose(P.H), full(P.M)}; }
  static Moment moment(const Link& l) noexcept { return {S(l.mass), vec(l.moment)}; }
  static Force momentum(const Link& l, const Motion& m) noexcept {
    const Vec3<S> h = vec(l.moment);
    const Sym3<S> I{S(l.inertia.xx), S(l.inertia.xy), S(l.inertia.xz),
                    S(l.inertia.yy), S(l.inertia.yz), S(l.inertia.zz)};
    return {I * m.w + cross(h, m.v), m.v * S(l.mass) - cross(h, m.w)};
  }

  static Force times(const Inertia& P, const Motion& m) noexcept {
    return {P.A * m.w + P.H * m.v, geometry::transposed_times(P.H, m.w) + P.M * m.v};
  }
  static Force times(const Operator& P, const Motion& m) noexcept {
    return {P.A * m.w + P.B * m.v, P.C * m.w + P.D * m.v};
  }
  static Force transposed_times(const Operator& P, const Motion& m) noexcept {
    return {geometry::transposed_times(P.A, m.w) + geometry::transposed_times(P.C, m.v),
            geometry::transposed_times(P.B, m.w) + geometry::transposed_times(P.D, m.v)};
  }
  /// P − k u uᵀ.
  static void subtract_outer(Inertia& P, const Force& u, S k) noexcept {
    const Force ku{u.t * k, u.f * k};
    P.A = minus_outer(P.A, u.t, k);
    P.M = minus_outer(P.M, u.f, k);
    P.H = minus_outer(P.H, ku.t, u.f);
  }
  /// P − u wᵀ.
  static void subtract_outer(Operator& P, const Force& u, const Force& w) noexcept {
    P = {minus_outer(P.A, u.t, w.t), minus_outer(P.B, u.t, w.f), minus_outer(P.C, u.f, w.t),
         minus_outer(P.D, u.f, w.f)};
  }
  static void add(Inertia& P, const Inertia& Q) noexcept { P = {P.A + Q.A, P.M + Q.M, P.H + Q.H}; }
  static void add(Operator& P, const Operator& Q) noexcept { P = {P.A + Q.A, P.B + Q.B, P.C + Q.C, P.D + Q.D}; }
  static void add(Moment& k, const Moment& j) noexcept { k = {k.m + j.m, k.h + j.h}; }

  /// ad(x) y, the bracket [x, y].
  static Motion ad(const Motion& x, const Motion& y) noexcept {
    return {cross(x.w, y.w), cross(x.v, y.w) + cross(x.w, y.v)};
  }
  /// adᵀ(x) f.
  static Force ad_T(const Motion& x, const Force& f) noexcept {
    return {cross(f.t, x.w) + cross(f.f, x.v), cross(f.f, x.w)};
  }
  static S pair(const Motion& m, const Force& f) noexcept { return dot(m.w, f.t) + dot(m.v, f.f); }

  /// Newton–Euler outwards: the parent's flow carried to the child, joint rate and acceleration added.
  static Flow advance(const Link& l, const Placement& x, const Flow& parent, S v, S a) noexcept {
    const Vec3<S> swing = cross(parent.dw, x.p) + cross(parent.w, cross(parent.w, x.p));
    Flow out{to_child(l, x, parent.w), to_child(l, x, parent.dw), to_child(l, x, parent.a + swing)};
    if (l.prismatic) {
      out.a.x += S(2) * out.w.y * v;
      out.a.y -= S(2) * out.w.x * v;
      out.a.z += a;
    } else {
      out.dw.x += out.w.y * v;
      out.dw.y -= out.w.x * v;
      out.dw.z += a;
      out.w.z += v;
    }
    return out;
  }
  /// The wrench about the frame's origin that moves the rigid link so (gravity enters through the root's acceleration).
  static Force inertial_force(const Link& l, const Flow& k) noexcept {
    const Vec3<S> h = vec(l.moment);
    const Sym3<S> I{S(l.inertia.xx), S(l.inertia.xy), S(l.inertia.xz),
                    S(l.inertia.yy), S(l.inertia.yz), S(l.inertia.zz)};
    return {I * k.dw + cross(k.w, I * k.w) + cross(h, k.a),
            k.a * S(l.mass) + cross(k.dw, h) + cross(k.w, cross(k.w, h))};
  }
  /// −g · (first moment), the potential energy of everything about the root's origin.
  static S potential(const Chain& chain, const Moment& k) noexcept { return -dot(vec(chain.gravity), k.h); }
};

}  // namespace hamelin::dynamics::kernel

#pragma once
#include <type_traits>

#include "hamelin/dynamics/kernel/lanes.hpp"
#include "hamelin/dynamics/kernel/spatial_inertia.hpp"
#include "hamelin/geometry/small.hpp"

namespace hamelin::dynamics::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

/// General operators from twists to wrenches.
template <class S, bool Mixed>
struct SpatialOperator : SpatialInertia<S, Mixed> {
  using Base = SpatialInertia<S, Mixed>;
  using Base::add;
  using Base::add_rigid;
  using Base::carry;
  using Base::inertia;
  using Base::is_prismatic;
  using Base::offset;
  using Base::rotated;
  using Base::subtract_outer;
  using Base::sum;
  using Base::times;
  using Base::vec;
  using typename Base::Force;
  using typename Base::Link;
  using typename Base::Motion;
  using typename Base::Placement;

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

  HAMELIN_INLINE static Force times(const Blocks& P, const Motion& m) noexcept {
    return {P.A * m.w + P.B * m.v, P.C * m.w + P.D * m.v};
  }
  HAMELIN_INLINE static Force transposed_times(const Blocks& P, const Motion& m) noexcept {
    return {geometry::transposed_times(P.A, m.w) + geometry::transposed_times(P.C, m.v),
            geometry::transposed_times(P.B, m.w) + geometry::transposed_times(P.D, m.v)};
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

  /// Pᵀ A.
  HAMELIN_INLINE static Force row(const Link& l, const Blocks& P) noexcept {
    return is_prismatic(l) ? Force{P.C.z, P.D.z} : Force{P.A.z, P.B.z};
  }
  HAMELIN_INLINE static Force row(const Link& l, const PackedBlocks& P) noexcept {
    const Vec3<Lanes<4>>& z = P.m.z;
    if (is_prismatic(l)) return {{z.x[2], z.y[2], z.z[2]}, {z.x[3], z.y[3], z.z[3]}};
    return {{z.x[0], z.y[0], z.z[0]}, {z.x[1], z.y[1], z.z[1]}};
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

  /// (a, b, a, b) and (a, a, b, b).
  HAMELIN_INLINE static Lanes<4> alternate(double a, double b) noexcept {
    return typename Lanes<4>::Real{a, b, a, b};
  }
  HAMELIN_INLINE static Lanes<4> pairwise(double a, double b) noexcept {
    return typename Lanes<4>::Real{a, a, b, b};
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
};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::dynamics::kernel

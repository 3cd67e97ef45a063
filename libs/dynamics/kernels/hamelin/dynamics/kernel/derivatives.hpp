#pragma once
#include <cmath>
#include <cstddef>
#include <type_traits>

#include "hamelin/dynamics/kernel/lanes.hpp"
#include "hamelin/geometry/small.hpp"

/// Derivatives of inverse and forward dynamics, docs/theory.md (2.24)–(2.29), for chains in either
/// group: everything is expressed in the axes of the world about one point. S is the scalar, double
/// or Lanes. The derivatives at one state have a row of joints in the lanes of registers; those at
/// many states are in kernel/state_derivatives.hpp.
namespace hamelin::dynamics::kernel {

/// Constants of a link: mass, Σ m r and Σ m r rᵀ of its particles in the axes of its frame, about
/// the frame's origin.
struct DerivativeLink {
  double mass, armature;
  geometry::Vec3<double> moment;
  geometry::Sym3<double> second;
  bool prismatic;
};

/// A link's frame in the world: columns of its rotation, its origin from the reference point, and
/// the joint's axis.
template <class S>
struct PlacedFrame {
  geometry::Vec3<S> x, y, z, p, axis;
};
struct DerivativeFrame : PlacedFrame<double> {};

inline namespace HAMELIN_ISA_NAMESPACE {

using geometry::Mat3;
using geometry::Sym3;
using geometry::Vec3;

/// A twist (angular, linear), or a wrench (moment, force).
template <class S>
struct Screw {
  Vec3<S> a, b;
};
template <class S>
HAMELIN_INLINE Screw<S> operator+(const Screw<S>& m, const Screw<S>& n) noexcept {
  return {m.a + n.a, m.b + n.b};
}
template <class S>
HAMELIN_INLINE Screw<S> operator*(const Screw<S>& m, const std::type_identity_t<S>& k) noexcept {
  return {m.a * k, m.b * k};
}
/// m × n of twists.
template <class S>
HAMELIN_INLINE Screw<S> bracket(const Screw<S>& m, const Screw<S>& n) noexcept {
  return {cross(m.a, n.a), cross(m.a, n.b) + cross(m.b, n.a)};
}
template <class S>
HAMELIN_INLINE S dot(const Screw<S>& m, const Screw<S>& f) noexcept {
  return dot(m.a, f.a) + dot(m.b, f.b);
}
/// m ×* f of a twist and a wrench.
template <class S>
HAMELIN_INLINE Screw<S> bracket_wrench(const Screw<S>& m, const Screw<S>& f) noexcept {
  return {cross(m.a, f.a) + cross(m.b, f.b), cross(m.a, f.b)};
}

/// Mass, Σ m r and Σ m r rᵀ of particles about the reference point.
template <class S>
struct Inertia {
  S mass;
  Vec3<S> moment;
  Sym3<S> second;
};
template <class S>
HAMELIN_INLINE Inertia<S> operator+(const Inertia<S>& p, const Inertia<S>& q) noexcept {
  return {p.mass + q.mass, p.moment + q.moment, p.second + q.second};
}

/// Sums over a link and all links outboard, docs/theory.md (2.26), (2.27).
template <class S>
struct Outboard {
  Inertia<S> inertia;
  Vec3<S> momentum;
  Mat3<S> flow;
  Screw<S> wrench;
};
template <class S>
HAMELIN_INLINE Outboard<S> operator+(const Outboard<S>& p, const Outboard<S>& q) noexcept {
  return {p.inertia + q.inertia, p.momentum + q.momentum, p.flow + q.flow, p.wrench + q.wrench};
}
/// The same for the energies, with the momentum as a wrench: docs/theory.md (2.30).
template <class S>
struct OutboardMomentum {
  Inertia<S> inertia;
  Screw<S> momentum;
};
template <class S>
HAMELIN_INLINE S trace(const Sym3<S>& a) noexcept {
  return a.xx + a.yy + a.zz;
}
template <class S>
HAMELIN_INLINE S trace(const Mat3<S>& a) noexcept {
  return a.x.x + a.y.y + a.z.z;
}
/// I m.
template <class S>
HAMELIN_INLINE Screw<S> operator*(const Inertia<S>& I, const Screw<S>& m) noexcept {
  return {m.a * trace(I.second) - I.second * m.a + cross(I.moment, m.b),
          m.b * I.mass + cross(m.a, I.moment)};
}
/// 2B m.
template <class S>
HAMELIN_INLINE Screw<S> coriolis_times(const Outboard<S>& o, const Screw<S>& m) noexcept {
  return {(m.a * trace(o.flow) - o.flow * m.a) * 2.0, cross(m.a, o.momentum) * 2.0};
}

/// The inertia of a link about the reference point.
template <class S>
HAMELIN_INLINE Inertia<S> placed(const DerivativeLink& l, const PlacedFrame<S>& f) noexcept {
  const Vec3<S> h = f.x * l.moment.x + f.y * l.moment.y + f.z * l.moment.z,
                moment = h + f.p * l.mass;
  // R E Rᵀ + h pᵀ + p (h + m p)ᵀ
  const Sym3<double>& e = l.second;
  const Vec3<S> ex = f.x * e.xx + f.y * e.xy + f.z * e.xz,
                ey = f.x * e.xy + f.y * e.yy + f.z * e.yz,
                ez = f.x * e.xz + f.y * e.yz + f.z * e.zz;
  const auto entry = [&](S Vec3<S>::*i, S Vec3<S>::*k) {
    return ex.*i * f.x.*k + ey.*i * f.y.*k + ez.*i * f.z.*k + h.*i * f.p.*k + f.p.*i * moment.*k;
  };
  using V = Vec3<S>;
  return {l.mass,
          moment,
          {entry(&V::x, &V::x), entry(&V::x, &V::y), entry(&V::x, &V::z), entry(&V::y, &V::y),
           entry(&V::y, &V::z), entry(&V::z, &V::z)}};
}

/// A link with its velocity and acceleration.
template <class S>
HAMELIN_INLINE Outboard<S> single(const DerivativeLink& l, const PlacedFrame<S>& f,
                                  const Screw<S>& velocity, const Screw<S>& acceleration) noexcept {
  Outboard<S> o;
  o.inertia = placed(l, f);
  const Vec3<S>& moment = o.inertia.moment;
  o.momentum = velocity.b * l.mass + cross(velocity.a, moment);
  const Mat3<S> turned = hat_times(velocity.a, full(o.inertia.second));
  o.flow = {turned.x + moment * velocity.b.x, turned.y + moment * velocity.b.y,
            turned.z + moment * velocity.b.z};
  o.wrench = o.inertia * acceleration + bracket_wrench(velocity, o.inertia * velocity);
  return o;
}

/// The screw of a joint about the reference point.
template <class S>
HAMELIN_INLINE Screw<S> screw_of(const DerivativeLink& l, const PlacedFrame<S>& f) noexcept {
  return l.prismatic ? Screw<S>{{0.0, 0.0, 0.0}, f.axis} : Screw<S>{f.axis, cross(f.p, f.axis)};
}

/// The screws of all joints, number by number, so that a row of the derivatives is computed in
/// lanes.
struct AxisRows {
  double* row[6];
  HAMELIN_INLINE Screw<double> at(std::size_t j) const noexcept {
    return {{row[0][j], row[1][j], row[2][j]}, {row[3][j], row[4][j], row[5][j]}};
  }
  HAMELIN_INLINE void set(std::size_t j, const Screw<double>& s) const noexcept {
    row[0][j] = s.a.x, row[1][j] = s.a.y, row[2][j] = s.a.z;
    row[3][j] = s.b.x, row[4][j] = s.b.y, row[5][j] = s.b.z;
  }
};

/// Scratch of a chain in memory that the caller owns; matrices have the leading dimension `ld`.
struct DerivativeScratch {
  std::size_t n, ld;
  AxisRows screw, first, second;
  double *rows_q, *rows_v;  ///< n × ld: rows of derivatives up to the diagonal
  Outboard<double>* outboard;
  OutboardMomentum<double>* momenta;

  HAMELIN_INLINE static std::size_t bytes(std::size_t n) noexcept {
    return (18 + 2 * n) * padded(n) * sizeof(double) +
           n * (sizeof(Outboard<double>) + sizeof(OutboardMomentum<double>));
  }
  HAMELIN_INLINE static DerivativeScratch at(void* memory, std::size_t n) noexcept {
    DerivativeScratch s{};
    s.n = n;
    s.ld = padded(n);
    double* at = static_cast<double*>(memory);
    const auto take = [&](std::size_t rows) {
      double* const taken = at;
      at += rows * s.ld;
      return taken;
    };
    for (AxisRows* rows : {&s.screw, &s.first, &s.second})
      for (double*& row : rows->row) row = take(1);
    s.rows_q = take(n);
    s.rows_v = take(n);
    s.outboard = reinterpret_cast<Outboard<double>*>(at);
    s.momenta = reinterpret_cast<OutboardMomentum<double>*>(s.outboard + n);
    return s;
  }
};

/// The screws of all joints and sums of links from the root on, docs/theory.md (2.24), (2.25).
/// `frame_of(i)` is called for one link after the other.
template <class S, class Scratch, class FrameOf>
HAMELIN_INLINE void sweep_outwards(const Scratch& k, const DerivativeLink* links,
                                   FrameOf&& frame_of, const Vec3<double>& gravity, const S* v,
                                   const S* a) noexcept {
  const Vec3<S> zero{0.0, 0.0, 0.0}, down{gravity.x, gravity.y, gravity.z};
  Screw<S> velocity{zero, zero}, acceleration{zero, zero - down};
  for (std::size_t i = 0; i < k.n; ++i) {
    const auto& f = frame_of(i);
    const Screw<S> screw = screw_of(links[i], f);
    const Screw<S> first = bracket(velocity, screw);
    k.screw.set(i, screw);
    k.first.set(i, first);
    k.second.set(i, bracket(acceleration, screw) + bracket(velocity, first));
    acceleration = acceleration + screw * a[i] + first * v[i];
    velocity = velocity + screw * v[i];
    k.outboard[i] = single(links[i], f, velocity, acceleration);
  }
}

/// What the products of docs/theory.md (2.28) take of joint i: wrenches, and a moment.
template <class S>
struct JointWrenches {
  Screw<S> by_q, by_v, inertial;
  Vec3<S> row;
};
template <class S>
HAMELIN_INLINE JointWrenches<S> wrenches_of(const Outboard<S>& o, const Screw<S>& screw,
                                            const Screw<S>& first,
                                            const Screw<S>& second) noexcept {
  return {
      coriolis_times(o, first) + o.inertia * second + bracket_wrench(screw, o.wrench),
      coriolis_times(o, screw) + o.inertia * first * 2.0, o.inertia * screw,
      (screw.a * trace(o.flow) - transposed_times(o.flow, screw.a) + cross(o.momentum, screw.b)) *
          2.0};
}

using NativePack = Lanes<native_lanes>;

/// out[j] = rows[j]·f for all j in packets up to `count`. Adds to what is there if `add`.
template <bool add>
HAMELIN_INLINE void products(const AxisRows& rows, const Screw<double>& f, std::size_t count,
                             double* out) noexcept {
  const double factor[] = {f.a.x, f.a.y, f.a.z, f.b.x, f.b.y, f.b.z};
  for (std::size_t j = 0; j < count; j += native_lanes) {
    NativePack sum = add ? NativePack::load(out + j) : NativePack(0.0);
    for (int k = 0; k < 6; ++k) sum += NativePack::load(rows.row[k] + j) * NativePack(factor[k]);
    sum.store(out + j);
  }
}
/// The same for wrenches without force.
template <bool add>
HAMELIN_INLINE void products(const AxisRows& rows, const Vec3<double>& moment, std::size_t count,
                             double* out) noexcept {
  for (std::size_t j = 0; j < count; j += native_lanes) {
    NativePack sum = add ? NativePack::load(out + j) : NativePack(0.0);
    sum += NativePack::load(rows.row[0] + j) * NativePack(moment.x);
    sum += NativePack::load(rows.row[1] + j) * NativePack(moment.y);
    sum += NativePack::load(rows.row[2] + j) * NativePack(moment.z);
    sum.store(out + j);
  }
}

/// docs/theory.md (2.28). dq, dv and M are column-major with leading dimension ld.
HAMELIN_INLINE void sweep_inwards(const DerivativeScratch& k, const DerivativeLink* links,
                                  double* dq, double* dv, double* M) noexcept {
  const std::size_t ld = k.ld;
  for (std::size_t i = k.n; i-- > 0;) {
    const Outboard<double>& o = k.outboard[i];
    const auto [by_q, by_v, inertial, row] =
        wrenches_of(o, k.screw.at(i), k.first.at(i), k.second.at(i));
    const std::size_t count = i + 1;
    products<false>(k.screw, by_q, count, dq + i * ld);
    products<false>(k.screw, by_v, count, dv + i * ld);
    products<false>(k.screw, inertial, count, M + i * ld);
    products<false>(k.first, row, count, k.rows_q + i * ld);
    products<true>(k.second, inertial, count, k.rows_q + i * ld);
    products<false>(k.screw, row, count, k.rows_v + i * ld);
    products<true>(k.first, inertial * 2.0, count, k.rows_v + i * ld);
    M[i + i * ld] += links[i].armature;
    if (i > 0) k.outboard[i - 1] = k.outboard[i - 1] + o;
  }
  // Packets have written beyond the diagonal, where the rows belong.
  for (std::size_t i = 0; i < k.n; ++i) {
    dq[i + i * ld] = k.rows_q[i + i * ld];
    dv[i + i * ld] = k.rows_v[i + i * ld];
    for (std::size_t j = 0; j < i; ++j) {
      dq[i + j * ld] = k.rows_q[j + i * ld];
      dv[i + j * ld] = k.rows_v[j + i * ld];
      M[i + j * ld] = M[j + i * ld];
    }
  }
}

/// Gradients and second derivatives of the energies, docs/theory.md (2.31), (2.32). Matrices are
/// column-major with leading dimension ld.
struct KineticOutput {
  double *p, *dq;         ///< ∂K/∂v and ∂K/∂q, n
  double *M, *mixed, *Q;  ///< ∂²K/∂v², ∂²K/∂v∂q with the momenta as rows, ∂²K/∂q²
};
struct PotentialOutput {
  double *dq, *Q;  ///< ∂U/∂q, n, and ∂²U/∂q²
};

/// docs/theory.md (2.30), (2.31)
HAMELIN_INLINE void kinetic_hessian(const DerivativeScratch& k, const DerivativeLink* links,
                                    const DerivativeFrame* frames, const double* v,
                                    const KineticOutput& out) noexcept {
  const std::size_t ld = k.ld;
  const Vec3<double> zero{0.0, 0.0, 0.0};
  Screw<double> velocity{zero, zero};
  for (std::size_t i = 0; i < k.n; ++i) {
    const Screw<double> screw = screw_of(links[i], frames[i]);
    k.screw.set(i, screw);
    k.first.set(i, bracket(velocity, screw));
    velocity = velocity + screw * v[i];
    const Inertia<double> inertia = placed(links[i], frames[i]);
    k.momenta[i] = {inertia, inertia * velocity};
  }
  for (std::size_t i = k.n; i-- > 0;) {
    const OutboardMomentum<double>& o = k.momenta[i];
    const Screw<double> screw = k.screw.at(i), first = k.first.at(i), column = o.inertia * screw,
                        turned = o.inertia * first + bracket_wrench(screw, o.momentum);
    const std::size_t count = i + 1;
    products<false>(k.screw, column, count, out.M + i * ld);
    products<false>(k.screw, turned, count, out.mixed + i * ld);
    products<false>(k.first, column, count, k.rows_v + i * ld);
    products<false>(k.first, turned, count, out.Q + i * ld);
    out.M[i + i * ld] += links[i].armature;
    out.p[i] = dot(screw, o.momentum) + links[i].armature * v[i];
    out.dq[i] = dot(first, o.momentum);
    if (i > 0) {
      OutboardMomentum<double>& inboard = k.momenta[i - 1];
      inboard = {inboard.inertia + o.inertia, inboard.momentum + o.momentum};
    }
  }
  for (std::size_t i = 0; i < k.n; ++i)
    for (std::size_t j = 0; j < i; ++j) {
      out.M[i + j * ld] = out.M[j + i * ld];
      out.Q[i + j * ld] = out.Q[j + i * ld];
      out.mixed[i + j * ld] = k.rows_v[j + i * ld];
    }
}

/// docs/theory.md (2.32)
HAMELIN_INLINE void potential_hessian(const DerivativeScratch& k, const DerivativeLink* links,
                                      const DerivativeFrame* frames, const Vec3<double>& gravity,
                                      const PotentialOutput& out) noexcept {
  const std::size_t ld = k.ld;
  double mass = 0.0;
  Vec3<double> moment{0.0, 0.0, 0.0};
  for (std::size_t i = 0; i < k.n; ++i) {
    const Screw<double> screw = screw_of(links[i], frames[i]);
    k.first.set(i, {cross(screw.a, gravity), screw.b});
  }
  for (std::size_t i = k.n; i-- > 0;) {
    const DerivativeFrame& f = frames[i];
    const DerivativeLink& l = links[i];
    mass += l.mass;
    moment = moment + f.x * l.moment.x + f.y * l.moment.y + f.z * l.moment.z + f.p * l.mass;
    const Screw<double> screw = screw_of(l, f);
    const Vec3<double> force = screw.b * mass + cross(screw.a, moment);
    products<false>(k.first, force, i + 1, out.Q + i * ld);
    out.dq[i] = -dot(force, gravity);
  }
  for (std::size_t i = 0; i < k.n; ++i)
    for (std::size_t j = 0; j < i; ++j) out.Q[i + j * ld] = out.Q[j + i * ld];
}

/// Inverts a symmetric positive definite matrix in place by Gauss–Jordan elimination, which needs
/// no pivots for such matrices. Rows from n to ld may have any finite numbers.
HAMELIN_INLINE void invert(std::size_t n, std::size_t ld, double* A) noexcept {
  for (std::size_t k = 0; k < n; ++k) {
    double* const pivot = A + k * ld;
    const double inverse = 1.0 / pivot[k];
    for (std::size_t j = 0; j < n; ++j) {
      if (j == k) continue;
      double* const column = A + j * ld;
      const double factor = column[k] * inverse;
      for (std::size_t i = 0; i < ld; i += native_lanes)
        (NativePack::load(column + i) - NativePack::load(pivot + i) * NativePack(factor))
            .store(column + i);
      column[k] = factor;
    }
    for (std::size_t i = 0; i < ld; i += native_lanes)
      (NativePack::load(pivot + i) * NativePack(-inverse)).store(pivot + i);
    pivot[k] = inverse;
  }
}

/// out = −A B, all n × n.
HAMELIN_INLINE void minus_product(std::size_t n, std::size_t ld, const double* A, const double* B,
                                  double* out) noexcept {
  for (std::size_t k = 0; k < n; ++k)
    for (std::size_t i = 0; i < ld; i += native_lanes) {
      NativePack sum(0.0);
      for (std::size_t j = 0; j < n; ++j)
        sum -= NativePack::load(A + i + j * ld) * NativePack(B[j + k * ld]);
      sum.store(out + i + k * ld);
    }
}

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::dynamics::kernel

#pragma once
#include <cmath>

#include "hamelin/dynamics/kernel/lanes.hpp"
#include "hamelin/model/chain.hpp"

namespace hamelin::dynamics::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

/// The operations of the sweeps in SE(2); names and meanings are those of kernel/spatial.hpp.
/// Twists are [w; vx; vy], wrenches [t; fx; fy].
template <class S, bool Mixed = true>
struct Planar {
  using Scalar = S;
  static constexpr bool has_prismatic_or_rotor = Mixed;
  static constexpr bool root_axes = false;  ///< each frame rotates with its link
  using Link = model::PlanarLink;
  using Chain = model::PlanarChain;

  struct Motion {
    S w, x, y;
  };
  struct Force {
    S t, x, y;
  };
  struct Placement {
    S s, c, px, py;
  };
  /// Symmetric 3×3 over [w, x, y].
  struct Inertia {
    S ww, wx, wy, xx, xy, yy;
  };
  /// Full 3×3 by rows.
  struct Operator {
    S ww, wx, wy, xw, xx, xy, yw, yx, yy;
  };
  using Blocks = Operator;
  struct Flow {
    S w, dw, ax, ay, ww;  ///< ww = w²
  };
  struct Moment {
    S m, x, y;
  };

  HAMELIN_INLINE static bool is_prismatic(const Link& l) noexcept { return Mixed && l.prismatic; }

  HAMELIN_INLINE static Motion sum(const Motion& a, const Motion& b) noexcept {
    return {a.w + b.w, a.x + b.x, a.y + b.y};
  }
  HAMELIN_INLINE static Force sum(const Force& a, const Force& b) noexcept {
    return {a.t + b.t, a.x + b.x, a.y + b.y};
  }
  HAMELIN_INLINE static Motion scaled(const Motion& a, S k) noexcept {
    return {a.w * k, a.x * k, a.y * k};
  }
  HAMELIN_INLINE static Force scaled(const Force& a, S k) noexcept {
    return {a.t * k, a.x * k, a.y * k};
  }

  HAMELIN_INLINE static Motion zero_motion() noexcept { return {S(0), S(0), S(0)}; }
  HAMELIN_INLINE static Force zero_force() noexcept { return {S(0), S(0), S(0)}; }
  HAMELIN_INLINE static Flow root_flow(const Chain& chain) noexcept {
    return {S(0), S(0), S(-chain.gravity_x), S(-chain.gravity_y), S(0)};
  }

  HAMELIN_INLINE static S angle(const Link& l, S q) noexcept {
    return is_prismatic(l) ? S(l.offset) : q * l.direction + l.offset;
  }
  HAMELIN_INLINE static void place(const Link& l, S q, S sine, S cosine, Placement& x) noexcept {
    x = {sine, cosine, S(l.p0x), S(l.p0y)};
    if (is_prismatic(l)) {
      x.px += q * cosine;
      x.py += q * sine;
    }
  }
  HAMELIN_INLINE static Placement place(const Link& l, double q) noexcept {
    Placement x;
    place(l, q, std::sin(angle(l, q)), std::cos(angle(l, q)), x);
    return x;
  }

  HAMELIN_INLINE static Motion to_child(const Link&, const Placement& x, const Motion& m) noexcept {
    const S vx = m.x - m.w * x.py, vy = m.y + m.w * x.px;
    return {m.w, x.c * vx + x.s * vy, x.c * vy - x.s * vx};
  }
  HAMELIN_INLINE static Force to_parent(const Link&, const Placement& x, const Force& f) noexcept {
    const S fx = x.c * f.x - x.s * f.y, fy = x.s * f.x + x.c * f.y;
    return {f.t + x.px * fy - x.py * fx, fx, fy};
  }
  HAMELIN_INLINE static Inertia to_parent(const Link&, const Placement& x,
                                          const Inertia& P) noexcept {
    const S d = P.xx - P.yy, cs = x.c * x.s, ss = x.s * x.s, k = d * ss + S(2) * P.xy * cs;
    const S xx = P.xx - k, xy = d * cs + P.xy * (S(1) - S(2) * ss), yy = P.yy + k;
    const S hx = x.c * P.wx - x.s * P.wy, hy = x.s * P.wx + x.c * P.wy;
    // v = v_parent + w (−py, px), and the moment about the parent's origin
    const S wx = hx + x.px * xy - x.py * xx, wy = hy + x.px * yy - x.py * xy;
    return {P.ww + x.px * (hy + wy) - x.py * (hx + wx), wx, wy, xx, xy, yy};
  }
  HAMELIN_INLINE static void carry(const Link& l, const Placement& x, Inertia& P, const Force&,
                                   S inv_d) noexcept {
    subtract_outer(P, column(l, P), inv_d);
    P = to_parent(l, x, P);
  }
  HAMELIN_INLINE static Moment to_parent(const Link&, const Placement& x,
                                         const Moment& k) noexcept {
    return {k.m, x.c * k.x - x.s * k.y + x.px * k.m, x.s * k.x + x.c * k.y + x.py * k.m};
  }

  HAMELIN_INLINE static Motion axis(const Link& l) noexcept {
    return is_prismatic(l) ? Motion{S(0), S(1), S(0)} : Motion{S(l.direction), S(0), S(0)};
  }
  HAMELIN_INLINE static S along_axis(const Link& l, const Force& f) noexcept {
    return is_prismatic(l) ? f.x : l.direction * f.t;
  }
  HAMELIN_INLINE static void add_along_axis(const Link& l, Motion& m, S k) noexcept {
    if (is_prismatic(l))
      m.x += k;
    else
      m.w += l.direction * k;
  }
  HAMELIN_INLINE static Force column(const Link& l, const Inertia& P) noexcept {
    if (is_prismatic(l)) return {P.wx, P.xx, P.xy};
    return {l.direction * P.ww, l.direction * P.wx, l.direction * P.wy};
  }

  HAMELIN_INLINE static S pivot(const Link& l, const Inertia& P) noexcept {
    return is_prismatic(l) ? P.xx : P.ww;
  }

  HAMELIN_INLINE static Inertia rigid(const Link& l) noexcept {
    return {S(l.inertia), S(-l.moment_y), S(l.moment_x), S(l.mass), S(0), S(l.mass)};
  }
  HAMELIN_INLINE static Inertia no_inertia() noexcept {
    return {S(0), S(0), S(0), S(0), S(0), S(0)};
  }
  HAMELIN_INLINE static void add_rigid(const Link& l, const Placement&, Inertia& P) noexcept {
    P.ww += S(l.inertia);
    P.wx -= S(l.moment_y);
    P.wy += S(l.moment_x);
    P.xx += S(l.mass);
    P.yy += S(l.mass);
  }
  HAMELIN_INLINE static Moment moment(const Link& l, const Placement&) noexcept {
    return {S(l.mass), S(l.moment_x), S(l.moment_y)};
  }
  HAMELIN_INLINE static Force momentum(const Link& l, const Placement&, const Motion& m) noexcept {
    return momentum(l, m);
  }
  HAMELIN_INLINE static Force momentum(const Link& l, const Motion& m) noexcept {
    return times(rigid(l), m);
  }

  HAMELIN_INLINE static Force times(const Inertia& P, const Motion& m) noexcept {
    return {P.ww * m.w + P.wx * m.x + P.wy * m.y, P.wx * m.w + P.xx * m.x + P.xy * m.y,
            P.wy * m.w + P.xy * m.x + P.yy * m.y};
  }
  HAMELIN_INLINE static Force times(const Operator& P, const Motion& m) noexcept {
    return {P.ww * m.w + P.wx * m.x + P.wy * m.y, P.xw * m.w + P.xx * m.x + P.xy * m.y,
            P.yw * m.w + P.yx * m.x + P.yy * m.y};
  }
  HAMELIN_INLINE static Force transposed_times(const Operator& P, const Motion& m) noexcept {
    return {P.ww * m.w + P.xw * m.x + P.yw * m.y, P.wx * m.w + P.xx * m.x + P.yx * m.y,
            P.wy * m.w + P.xy * m.x + P.yy * m.y};
  }
  HAMELIN_INLINE static void subtract_outer(Inertia& P, const Force& u, S k) noexcept {
    const Force a = scaled(u, k);
    P = {P.ww - a.t * u.t, P.wx - a.t * u.x, P.wy - a.t * u.y,
         P.xx - a.x * u.x, P.xy - a.x * u.y, P.yy - a.y * u.y};
  }
  HAMELIN_INLINE static void subtract_outer(Operator& P, const Force& u, const Force& w) noexcept {
    P = {P.ww - u.t * w.t, P.wx - u.t * w.x, P.wy - u.t * w.y, P.xw - u.x * w.t, P.xx - u.x * w.x,
         P.xy - u.x * w.y, P.yw - u.y * w.t, P.yx - u.y * w.x, P.yy - u.y * w.y};
  }
  HAMELIN_INLINE static void add(Inertia& P, const Inertia& Q) noexcept {
    P = {P.ww + Q.ww, P.wx + Q.wx, P.wy + Q.wy, P.xx + Q.xx, P.xy + Q.xy, P.yy + Q.yy};
  }
  HAMELIN_INLINE static void add(Operator& P, const Operator& Q) noexcept {
    P = {P.ww + Q.ww, P.wx + Q.wx, P.wy + Q.wy, P.xw + Q.xw, P.xx + Q.xx,
         P.xy + Q.xy, P.yw + Q.yw, P.yx + Q.yx, P.yy + Q.yy};
  }
  HAMELIN_INLINE static void add(Moment& k, const Moment& j) noexcept {
    k = {k.m + j.m, k.x + j.x, k.y + j.y};
  }

  HAMELIN_INLINE static Force ad_T(const Motion& a, const Force& f) noexcept {
    return {a.y * f.x - a.x * f.y, a.w * f.y, -(a.w * f.x)};
  }
  HAMELIN_INLINE static S pair(const Motion& m, const Force& f) noexcept {
    return m.w * f.t + m.x * f.x + m.y * f.y;
  }

  HAMELIN_INLINE static Motion bracket(const Link& l, const Motion& X) noexcept {
    if (is_prismatic(l)) return {S(0.0), S(0.0), X.w};
    return {S(0.0), X.y * l.direction, -X.x * l.direction};
  }
  HAMELIN_INLINE static Force ad_transposed_axis(const Link& l, const Force& f) noexcept {
    if (is_prismatic(l)) return {-f.y, S(0.0), S(0.0)};
    return {S(0.0), f.y * l.direction, -f.x * l.direction};
  }
  HAMELIN_INLINE static Force times_axis_plus(const Link& l, const Operator& P,
                                              const Motion& b) noexcept {
    const Force turned{P.wx * b.x + P.wy * b.y, P.xx * b.x + P.xy * b.y, P.yx * b.x + P.yy * b.y};
    if (is_prismatic(l)) return sum({P.wx, P.xx, P.yx}, turned);
    return sum({P.ww * l.direction, P.xw * l.direction, P.yw * l.direction}, turned);
  }
  HAMELIN_INLINE static Force transposed_times_axis_minus(const Link& l, const Operator& P,
                                                          const Motion& b) noexcept {
    const Force turned{P.xw * b.x + P.yw * b.y, P.xx * b.x + P.yx * b.y, P.xy * b.x + P.yy * b.y};
    const Force row = is_prismatic(l)
                          ? Force{P.xw, P.xx, P.xy}
                          : Force{P.ww * l.direction, P.wx * l.direction, P.wy * l.direction};
    return {row.t - turned.t, row.x - turned.x, row.y - turned.y};
  }
  HAMELIN_INLINE static Force row(const Link& l, const Operator& P) noexcept {
    if (is_prismatic(l)) return {P.xw, P.xx, P.xy};
    return {P.ww * l.direction, P.wx * l.direction, P.wy * l.direction};
  }
  HAMELIN_INLINE static Operator no_operator() noexcept {
    const S o = S(0.0);
    return {o, o, o, o, o, o, o, o, o};
  }
  HAMELIN_INLINE static void add_rigid(const Link& l, const Placement&, Operator& P) noexcept {
    P.ww += S(l.inertia);
    P.wx -= S(l.moment_y);
    P.wy += S(l.moment_x);
    P.xw -= S(l.moment_y);
    P.yw += S(l.moment_x);
    P.xx += S(l.mass);
    P.yy += S(l.mass);
  }
  HAMELIN_INLINE static void carry(const Link&, const Placement& x, Operator& P) noexcept {
    const auto turn = [&](S a, S b, S& u, S& v) {
      u = x.c * a - x.s * b;
      v = x.s * a + x.c * b;
    };
    Operator Q = P;
    turn(P.wx, P.wy, Q.wx, Q.wy);
    turn(P.xw, P.yw, Q.xw, Q.yw);
    S ax, ay, bx, by;  // R D, column by column, then Rᵀ from the right
    turn(P.xx, P.yx, ax, ay);
    turn(P.xy, P.yy, bx, by);
    turn(ax, bx, Q.xx, Q.xy);
    turn(ay, by, Q.yx, Q.yy);
    // motion: v += w (−py, px);  force: t += p × f
    const S cx = Q.xw - Q.xx * x.py + Q.xy * x.px, cy = Q.yw - Q.yx * x.py + Q.yy * x.px;
    const S cw = Q.ww - Q.wx * x.py + Q.wy * x.px;
    P = {cw + x.px * cy - x.py * cx,
         Q.wx + x.px * Q.yx - x.py * Q.xx,
         Q.wy + x.px * Q.yy - x.py * Q.xy,
         cx,
         Q.xx,
         Q.xy,
         cy,
         Q.yx,
         Q.yy};
  }
  HAMELIN_INLINE static Operator spin_operator(S w, const Placement&,
                                               const geometry::Vec3<double>& p) noexcept {
    const S o = S(0.0), xw = -w * p.x, yw = -w * p.y;
    return {yw * p.x - xw * p.y, w * p.x, w * p.y, xw, o, -w, yw, w, o};
  }

  HAMELIN_INLINE static S coriolis_torque(const Link& l, const Motion& X,
                                          const Force& lambda) noexcept {
    if (is_prismatic(l)) return lambda.y * X.w;  // [X, e_x] = (0; 0, w)
    return (lambda.x * X.y - lambda.y * X.x) * l.direction;
  }

  HAMELIN_INLINE static Flow advance(const Link& l, const Placement& x, const Flow& parent, S v,
                                     S a) noexcept {
    const S ax = parent.ax - parent.dw * x.py - parent.ww * x.px,
            ay = parent.ay + parent.dw * x.px - parent.ww * x.py;
    Flow out{parent.w, parent.dw, x.c * ax + x.s * ay, x.c * ay - x.s * ax, parent.ww};
    if (is_prismatic(l)) {
      out.ax += a;
      out.ay += S(2) * parent.w * v;
    } else {
      out.w += v * l.direction;
      out.dw += a * l.direction;
      out.ww = out.w * out.w;
    }
    return out;
  }
  HAMELIN_INLINE static Force inertial_force(const Link& l, const Placement&,
                                             const Flow& k) noexcept {
    return {k.dw * l.inertia + k.ay * l.moment_x - k.ax * l.moment_y,
            k.ax * l.mass - k.dw * l.moment_y - k.ww * l.moment_x,
            k.ay * l.mass + k.dw * l.moment_x - k.ww * l.moment_y};
  }
  HAMELIN_INLINE static S potential(const Chain& chain, const Moment& k) noexcept {
    return -(k.x * chain.gravity_x + k.y * chain.gravity_y);
  }

  struct Direction {
    S x, y;
  };
  HAMELIN_INLINE static Direction to_child(const Link&, const Placement& x,
                                           const Direction& d) noexcept {
    return {x.c * d.x + x.s * d.y, x.c * d.y - x.s * d.x};
  }
  HAMELIN_INLINE static Direction gravity(const Chain& chain) noexcept {
    return {S(chain.gravity_x), S(chain.gravity_y)};
  }
  HAMELIN_INLINE static Moment no_moment() noexcept { return {S(0), S(0), S(0)}; }
  /// Only the component of w along the plane's normal has an effect in the plane.
  HAMELIN_INLINE static S spin_axis(const geometry::Vec3<double>& w) noexcept { return S(w.z); }
  HAMELIN_INLINE static S to_child_axis(const Link&, const Placement&, S w) noexcept { return w; }
  HAMELIN_INLINE static Force spin_force(S w, const Placement&, const geometry::Vec3<double>& p,
                                         const Motion& m) noexcept {
    const S fx = -w * (m.y + m.w * p.x), fy = w * (m.x - m.w * p.y);
    return {fy * p.x - fx * p.y, fx, fy};
  }

  HAMELIN_INLINE static S gravity_torque(const Link& l, const Direction& g,
                                         const Moment& k) noexcept {
    return is_prismatic(l) ? k.m * g.x : (k.x * g.y - k.y * g.x) * l.direction;
  }
};

/// SE(2) for chains with revolute joints only, in frames that are all parallel to the root's. A
/// link's angle rotates only the link's own constants; what the sweeps pass from link to link is
/// translated but not rotated. This takes about half the operations, and fewer of them depend on
/// each other.
template <class S>
struct PlanarParallel : Planar<S, false> {
  using Base = Planar<S, false>;
  using Link = typename Base::Link;
  using Motion = typename Base::Motion;
  using Force = typename Base::Force;
  using Inertia = typename Base::Inertia;
  using Operator = typename Base::Operator;
  using Flow = typename Base::Flow;
  using Moment = typename Base::Moment;
  using Direction = typename Base::Direction;
  static constexpr bool root_axes = true;

  /// Orientation, offset from the parent's origin and first moment, all in root axes.
  struct Placement {
    S s, c, px, py, hx, hy;
  };

  HAMELIN_INLINE static void place(const Link& l, S parent_s, S parent_c, S s, S c,
                                   Placement& x) noexcept {
    x = {s,
         c,
         parent_c * l.p0x - parent_s * l.p0y,
         parent_s * l.p0x + parent_c * l.p0y,
         c * l.moment_x - s * l.moment_y,
         s * l.moment_x + c * l.moment_y};
  }

  HAMELIN_INLINE static Motion to_child(const Link&, const Placement& x, const Motion& m) noexcept {
    return {m.w, m.x - m.w * x.py, m.y + m.w * x.px};
  }
  HAMELIN_INLINE static Direction to_child(const Link&, const Placement&,
                                           const Direction& d) noexcept {
    return d;
  }
  HAMELIN_INLINE static Force to_parent(const Link&, const Placement& x, const Force& f) noexcept {
    return {f.t + x.px * f.y - x.py * f.x, f.x, f.y};
  }
  HAMELIN_INLINE static Moment to_parent(const Link&, const Placement& x,
                                         const Moment& k) noexcept {
    return {k.m, k.x + x.px * k.m, k.y + x.py * k.m};
  }
  HAMELIN_INLINE static Inertia to_parent(const Link&, const Placement& x,
                                          const Inertia& P) noexcept {
    const S wx = P.wx + x.px * P.xy - x.py * P.xx, wy = P.wy + x.px * P.yy - x.py * P.xy;
    return {P.ww + x.px * (P.wy + wy) - x.py * (P.wx + wx), wx, wy, P.xx, P.xy, P.yy};
  }
  /// Inboard of the joint the row and column of w vanish, and those of the parent follow from the
  /// rest. The parent's pivot needs nᵀ(M − h hᵀ/d)n with n = (−p_y, p_x), h = (P.wx, P.wy) and M
  /// the block of x and y; it is written with only one product that depends on 1/d.
  HAMELIN_INLINE static void carry(const Link&, const Placement& x, Inertia& P, const Force&,
                                   S inv_d) noexcept {
    const S nh = x.px * P.wy - x.py * P.wx;
    const S n_mn = x.px * (x.px * P.yy - x.py * P.xy) - x.py * (x.px * P.xy - x.py * P.xx);
    P.ww = n_mn - (nh * nh) * inv_d;
    const S kx = P.wx * inv_d, ky = P.wy * inv_d;
    P.xx -= kx * P.wx;
    P.xy -= kx * P.wy;
    P.yy -= ky * P.wy;
    P.wx = x.px * P.xy - x.py * P.xx;
    P.wy = x.px * P.yy - x.py * P.xy;
  }
  HAMELIN_INLINE static void carry(const Link&, const Placement& x, Operator& P) noexcept {
    // motion: v += w (−py, px);  force: t += p × f
    P.ww += x.px * P.wy - x.py * P.wx;
    P.xw += x.px * P.xy - x.py * P.xx;
    P.yw += x.px * P.yy - x.py * P.yx;
    P.ww += x.px * P.yw - x.py * P.xw;
    P.wx += x.px * P.yx - x.py * P.xx;
    P.wy += x.px * P.yy - x.py * P.xy;
  }

  HAMELIN_INLINE static void add_rigid(const Link& l, const Placement& x, Inertia& P) noexcept {
    P.ww += S(l.inertia);
    P.wx -= x.hy;
    P.wy += x.hx;
    P.xx += S(l.mass);
    P.yy += S(l.mass);
  }
  HAMELIN_INLINE static void add_rigid(const Link& l, const Placement& x, Operator& P) noexcept {
    P.ww += S(l.inertia);
    P.wx -= x.hy;
    P.wy += x.hx;
    P.xw -= x.hy;
    P.yw += x.hx;
    P.xx += S(l.mass);
    P.yy += S(l.mass);
  }
  HAMELIN_INLINE static Moment moment(const Link& l, const Placement& x) noexcept {
    return {S(l.mass), x.hx, x.hy};
  }
  HAMELIN_INLINE static Force momentum(const Link& l, const Placement& x,
                                       const Motion& m) noexcept {
    return {m.w * l.inertia + x.hx * m.y - x.hy * m.x, m.x * l.mass - m.w * x.hy,
            m.y * l.mass + m.w * x.hx};
  }

  HAMELIN_INLINE static Flow advance(const Link& l, const Placement& x, const Flow& parent, S v,
                                     S a) noexcept {
    const S w = parent.w + v * l.direction;
    return {w, parent.dw + a * l.direction, parent.ax - parent.dw * x.py - parent.ww * x.px,
            parent.ay + parent.dw * x.px - parent.ww * x.py, w * w};
  }
  HAMELIN_INLINE static Force inertial_force(const Link& l, const Placement& x,
                                             const Flow& k) noexcept {
    return {k.dw * l.inertia + k.ay * x.hx - k.ax * x.hy, k.ax * l.mass - k.dw * x.hy - k.ww * x.hx,
            k.ay * l.mass + k.dw * x.hx - k.ww * x.hy};
  }

  /// u − m·f. In a sweep outwards m.w is known last, so its product is subtracted last.
  HAMELIN_INLINE static S minus_pair(S u, const Motion& m, const Force& f) noexcept {
    return ((u - m.x * f.x) - m.y * f.y) - m.w * f.t;
  }

  HAMELIN_INLINE static S to_child_axis(const Link&, const Placement&, S w) noexcept { return w; }
  HAMELIN_INLINE static Force spin_force(S w, const Placement& x,
                                         const geometry::Vec3<double>& point,
                                         const Motion& m) noexcept {
    const S px = x.c * point.x - x.s * point.y, py = x.s * point.x + x.c * point.y;
    const S fx = -w * (m.y + m.w * px), fy = w * (m.x - m.w * py);
    return {px * fy - py * fx, fx, fy};
  }
  HAMELIN_INLINE static Operator spin_operator(S w, const Placement& x,
                                               const geometry::Vec3<double>& point) noexcept {
    const S px = x.c * point.x - x.s * point.y, py = x.s * point.x + x.c * point.y;
    const S o = S(0.0), xw = -w * px, yw = -w * py;
    return {px * yw - py * xw, w * px, w * py, xw, o, -w, yw, w, o};
  }
};

/// Mixed: with prismatic joints and rotor inertias. Plain: without.
template <class S>
using PlanarMixed = Planar<S, true>;
template <class S>
using PlanarPlain = PlanarParallel<S>;

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::dynamics::kernel

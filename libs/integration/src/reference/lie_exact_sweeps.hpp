#pragma once
#include <array>
#include <cmath>
#include <vector>

#include "hamelin/dynamics/kernel/planar.hpp"
#include "hamelin/dynamics/kernel/spatial.hpp"
#include "hamelin/geometry/dexp_coefficients.hpp"

/// The sweeps of lie-exact and their exact linearisation, derived in docs/theory.md (6.1)–(6.17).
namespace hamelin::integration::kernel {

using Vec3 = geometry::Vec3<double>;
using Mat3 = geometry::Mat3<double>;
using Screw = dynamics::kernel::Spatial<double>::Motion;
using Wrench = dynamics::kernel::Spatial<double>::Force;
using Blocks = dynamics::kernel::Spatial<double>::Blocks;

[[nodiscard]] HAMELIN_INLINE Mat3 product(const Mat3& a, const Mat3& b) noexcept {
  return {b.x * a.x.x + b.y * a.x.y + b.z * a.x.z, b.x * a.y.x + b.y * a.y.y + b.z * a.y.z,
          b.x * a.z.x + b.y * a.z.y + b.z * a.z.z};
}
[[nodiscard]] HAMELIN_INLINE Mat3 hat(const Vec3& a) noexcept {
  return {{0.0, -a.z, a.y}, {a.z, 0.0, -a.x}, {-a.y, a.x, 0.0}};
}
[[nodiscard]] HAMELIN_INLINE Mat3 outer(const Vec3& a, const Vec3& b) noexcept {
  return {b * a.x, b * a.y, b * a.z};
}
[[nodiscard]] HAMELIN_INLINE Mat3 scaled(const Mat3& a, double k) noexcept {
  return {a.x * k, a.y * k, a.z * k};
}

/// A displacement as a unit dual quaternion (s + ε ds) + (u.w + ε u.v). Near the identity its
/// vector part keeps full relative precision, and it changes frames as a twist does.
struct Displacement {
  double s = 1.0, ds = 0.0;
  Screw u{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
};

[[nodiscard]] inline Displacement operator*(const Displacement& a, const Displacement& b) noexcept {
  using geometry::cross;
  using geometry::dot;
  return {a.s * b.s - dot(a.u.w, b.u.w),
          a.s * b.ds + a.ds * b.s - dot(a.u.w, b.u.v) - dot(a.u.v, b.u.w),
          {b.u.w * a.s + a.u.w * b.s + cross(a.u.w, b.u.w),
           b.u.v * a.s + b.u.w * a.ds + a.u.v * b.s + a.u.w * b.ds + cross(a.u.w, b.u.v) +
               cross(a.u.v, b.u.w)}};
}

/// The twist x whose exponential is the displacement, docs/theory.md (6.4). False if the
/// displacement turns by more than 2.9 rad.
[[nodiscard]] inline bool logarithm(const Displacement& d, Screw& x) noexcept {
  if (!(d.s > 0.12)) return false;
  const double y = geometry::dot(d.u.w, d.u.w), n = std::sqrt(y), angle = std::atan2(n, d.s);
  // (tan φ − φ)/sin³φ with φ half the angle; below sin φ = 0.1 its series in sin²φ, to 1e-19
  double twist;
  if (y < 0.01) {
    double b = 1.0;
    std::array<double, 9> c{};
    for (std::size_t k = 1; k <= c.size(); ++k) {
      const auto m = static_cast<double>(k);
      b *= (2.0 * m - 1.0) / (2.0 * m);
      c[k - 1] = b * 2.0 * m / (2.0 * m + 1.0);
    }
    twist = geometry::polynomial(c, y);
  } else {
    twist = (n / d.s - angle) / (y * n);
  }
  const double scale = y < 1e-16 ? 2.0 / d.s : 2.0 * angle / n;
  x = {d.u.w * scale, d.u.v * scale + d.u.w * (2.0 * twist * geometry::dot(d.u.w, d.u.v))};
  return true;
}

/// dexp⁻¹ and its derivatives at x = (w, v), docs/theory.md (6.10)–(6.13). With
/// j(a) = a + ½ w × a + e w × (w × a), dexp⁻ᵀ_x (t, f) = (j(t) + ∂_w j(f)·v, j(f)).
struct InverseExp {
  Screw x;
  double e, de, dde;  ///< e(θ), e'/θ, (e'/θ)'/θ
  double w_dot_v;     ///< w·v

  explicit InverseExp(const Screw& at) noexcept : x(at), w_dot_v(geometry::dot(at.w, at.v)) {
    const double y = geometry::dot(x.w, x.w);
    const auto c = geometry::inverse_exp_coefficients(y);
    e = c.e;
    de = c.de;
    if (y < 1.0) {
      // e = Σ |B₂ₖ|/(2k)! θ^(2k−2), differentiated twice
      constexpr std::array<double, 8> s{8.0 / 30240.0,
                                        24.0 / 1209600.0,
                                        48.0 / 47900160.0,
                                        80.0 * 691.0 / 1307674368000.0,
                                        120.0 / 74724249600.0,
                                        168.0 * 3617.0 / 10670622842880000.0,
                                        224.0 * 43867.0 / 5109094217170944000.0,
                                        288.0 * 174611.0 / 330.0 / 2432902008176640000.0};
      dde = geometry::polynomial(s, y);
    } else {
      const double slope = -c.e - 0.5 * y * c.de;  // dγ/dy
      dde = 2.0 * ((-slope * c.e - 0.5 * (c.gamma + 2.0) * c.de) - c.de) / y;
    }
  }

  /// dexp⁻ᵀ_{±x} of a wrench, docs/theory.md (6.11); sign is +1 or −1.
  [[nodiscard]] Wrench transposed(const Wrench& p, double sign) const noexcept {
    using geometry::cross;
    const Vec3 wf = cross(x.w, p.f), wwf = cross(x.w, wf), wt = cross(x.w, p.t);
    const Vec3 turned = cross(x.v, wf) + cross(x.w, cross(x.v, p.f));
    const Vec3 moment = p.t + wt * (0.5 * sign) + cross(x.w, wt) * e +
                        cross(x.v, p.f) * (0.5 * sign) + turned * e + wwf * (w_dot_v * de);
    return {moment, p.f + wf * (0.5 * sign) + wwf * e};
  }
  /// j as a matrix: the diagonal block of dexp⁻ᵀ_x and dexp⁻¹_{−x}.
  [[nodiscard]] Mat3 diagonal() const noexcept {
    Mat3 a = scaled(hat(x.w), 0.5) + scaled(product(hat(x.w), hat(x.w)), e);
    a.x.x += 1.0;
    a.y.y += 1.0;
    a.z.z += 1.0;
    return a;
  }
  /// ∂_w j(·)·v as a matrix: the upper right block of dexp⁻ᵀ_x and the lower left of dexp⁻¹_{−x}.
  [[nodiscard]] Mat3 off_diagonal() const noexcept {
    const Mat3 W = hat(x.w), V = hat(x.v);
    return scaled(V, 0.5) + scaled(product(W, V) + product(V, W), e) +
           scaled(product(W, W), w_dot_v * de);
  }
  /// ∂_w j(a) as a matrix.
  [[nodiscard]] Mat3 diagonal_derivative(const Vec3& a) const noexcept {
    const Vec3 wa = geometry::cross(x.w, a);
    return scaled(hat(a), -0.5) + scaled(hat(wa) + product(hat(x.w), hat(a)), -e) +
           scaled(outer(geometry::cross(x.w, wa), x.w), de);
  }
  /// ∂_w (∂_w j(a)·v) as a matrix.
  [[nodiscard]] Mat3 off_diagonal_derivative(const Vec3& a) const noexcept {
    using geometry::cross;
    const Vec3 wa = cross(x.w, a), va = cross(x.v, a), wwa = cross(x.w, wa);
    const Vec3 cross_terms = cross(x.v, wa) + cross(x.w, va);
    return scaled(outer(cross_terms, x.w) + outer(wwa, x.v), de) +
           scaled(product(hat(x.v), hat(a)) + hat(va), -e) +
           scaled(outer(wwa, x.w), dde * w_dot_v) +
           scaled(hat(wa) + product(hat(x.w), hat(a)), -de * w_dot_v);
  }
  /// N of docs/theory.md (6.12) for μ = I x/h and I = [A H; Hᵀ M].
  [[nodiscard]] Blocks stiffness(const Mat3& A, const Mat3& H, const Mat3& M, const Wrench& mu,
                                 double h) const noexcept {
    const Mat3 J = diagonal(), Q = off_diagonal(), Ht = geometry::transpose(H),
               G = diagonal_derivative(mu.f);
    const double k = 1.0 / h;
    const Mat3 a = scaled(product(J, A) + product(Q, Ht), k) + diagonal_derivative(mu.t) +
                   off_diagonal_derivative(mu.f);
    const Mat3 b = scaled(product(J, H) + product(Q, M), k) + G;
    const Mat3 c = scaled(product(J, Ht), k) + G;
    const Mat3 d = scaled(product(J, M), k);
    return {product(a, J) + product(b, Q), product(b, J), product(c, J) + product(d, Q),
            product(d, J)};
  }
};

/// Converts twists, wrenches and inertias of a group to space and back, and transports operators by
/// two placements.
template <class Space>
struct SpatialForm;

template <>
struct SpatialForm<dynamics::kernel::Spatial<double>> {
  using Space = dynamics::kernel::Spatial<double>;
  static Screw to_space(const Space::Motion& m) noexcept { return m; }
  static Space::Motion from_space(const Screw& m) noexcept { return m; }
  static Wrench to_space(const Space::Force& f) noexcept { return f; }
  static Space::Force from_space(const Wrench& f, const Space::Force*) noexcept { return f; }
  static Space::Blocks stiffness(const InverseExp& d, const Space::Link& l, const Wrench& mu,
                                 double h) noexcept {
    const auto I = Space::rigid(l);
    return d.stiffness(geometry::full(I.A), I.H, geometry::full(I.M), mu, h);
  }
  /// Adᵀ(left⁻¹) P Ad(right⁻¹).
  static Space::Blocks to_parent(const Space::Link& l, const Space::Placement& left,
                                 const Space::Placement& right, const Space::Blocks& P) noexcept {
    const auto rotated = [&](const Mat3& a) {
      const Mat3 rows{Space::to_parent(l, right, a.x), Space::to_parent(l, right, a.y),
                      Space::to_parent(l, right, a.z)};
      const Mat3 cols = geometry::transpose(rows);
      return geometry::transpose(Mat3{Space::to_parent(l, left, cols.x),
                                      Space::to_parent(l, left, cols.y),
                                      Space::to_parent(l, left, cols.z)});
    };
    const Mat3 A = rotated(P.A), B = rotated(P.B), C = rotated(P.C), D = rotated(P.D);
    const Mat3 shifted = C - geometry::times_hat(D, right.p);
    return {A - geometry::times_hat(B, right.p) + geometry::hat_times(left.p, shifted),
            B + geometry::hat_times(left.p, D), shifted, D};
  }
};

template <>
struct SpatialForm<dynamics::kernel::Planar<double>> {
  using Space = dynamics::kernel::Planar<double>;
  static Screw to_space(const Space::Motion& m) noexcept {
    return {{0.0, 0.0, m.w}, {m.x, m.y, 0.0}};
  }
  static Space::Motion from_space(const Screw& m) noexcept { return {m.w.z, m.v.x, m.v.y}; }
  static Wrench to_space(const Space::Force& f) noexcept {
    return {{0.0, 0.0, f.t}, {f.x, f.y, 0.0}};
  }
  static Space::Force from_space(const Wrench& f, const Space::Force*) noexcept {
    return {f.t.z, f.f.x, f.f.y};
  }
  static Space::Blocks stiffness(const InverseExp& d, const Space::Link& l, const Wrench& mu,
                                 double h) noexcept {
    const Mat3 A{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {0.0, 0.0, l.inertia}};
    const Mat3 H{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {-l.moment_y, l.moment_x, 0.0}};
    const Mat3 M{{l.mass, 0.0, 0.0}, {0.0, l.mass, 0.0}, {0.0, 0.0, l.mass}};
    const Blocks k = d.stiffness(A, H, M, mu, h);
    return {k.A.z.z, k.B.z.x, k.B.z.y, k.C.x.z, k.D.x.x, k.D.x.y, k.C.y.z, k.D.y.x, k.D.y.y};
  }
  static Space::Blocks to_parent(const Space::Link& l, const Space::Placement& left,
                                 const Space::Placement& right, const Space::Blocks& P) noexcept {
    // transport the operator's columns as wrenches by `left`, then its rows by `right`
    const auto t = Space::to_parent(l, left, Space::Force{P.ww, P.xw, P.yw});
    const auto x = Space::to_parent(l, left, Space::Force{P.wx, P.xx, P.yx});
    const auto y = Space::to_parent(l, left, Space::Force{P.wy, P.xy, P.yy});
    const auto a = Space::to_parent(l, right, Space::Force{t.t, x.t, y.t});
    const auto b = Space::to_parent(l, right, Space::Force{t.x, x.x, y.x});
    const auto c = Space::to_parent(l, right, Space::Force{t.y, x.y, y.y});
    return {a.t, a.x, a.y, b.t, b.x, b.y, c.t, c.x, c.y};
  }
};

template <class Space>
struct LieLink {
  typename Space::Placement before{}, after{};  ///< at θ^k and θ^{k+1}
  Displacement displacement{};                  ///< D of the link in a step, in its own frame
  Screw x{};                                    ///< log D
  typename Space::Force momentum{};             ///< μ = I x/h
  typename Space::Force lambda{};

  typename Space::Placement after_kept{};
  typename Space::Blocks P{};  ///< δλ = P η + s, with η the variation of the pose at θ^{k+1}
  typename Space::Force u{}, w{};
  double inv_d{};

  typename Space::Force s{};
  typename Space::Motion eta{};
  double r{};
};

template <class Space>
using LieScratch = std::vector<LieLink<Space>>;

/// minus[i] = p_i⁻, docs/theory.md (6.3), (6.6). Requires `before` to be set. False if a link turns
/// too far in the step.
template <class Space>
[[nodiscard]] bool lie_left_momenta(const typename Space::Chain& chain, LieScratch<Space>& k,
                                    const double* delta, double h, double* minus) noexcept {
  using Form = SpatialForm<Space>;
  for (std::size_t i = 0; i < k.size(); ++i) {
    const auto& l = chain.links[i];
    auto& link = k[i];
    Displacement carried;
    if (l.parent >= 0) {
      const auto& parent = k[static_cast<std::size_t>(l.parent)].displacement;
      carried = {parent.s, parent.ds,
                 Form::to_space(Space::to_child(l, link.before, Form::from_space(parent.u)))};
    }
    Displacement joint;
    auto axis = Space::zero_motion();
    const double half = 0.5 * delta[i];
    if (!l.prismatic) joint.s = std::cos(half);
    Space::add_along_axis(l, axis, l.prismatic ? half : std::sin(half));
    joint.u = Form::to_space(axis);
    link.displacement = carried * joint;
    if (!logarithm(link.displacement, link.x)) return false;
    link.momentum = Space::scaled(Space::momentum(l, Form::from_space(link.x)), 1.0 / h);
    link.lambda = Form::from_space(
        InverseExp(link.x).transposed(Form::to_space(link.momentum), 1.0), &link.lambda);
  }
  for (std::size_t i = k.size(); i-- > 0;) {
    const auto& l = chain.links[i];
    minus[i] = Space::along_axis(l, k[i].lambda) + delta[i] / h * l.armature;
    if (l.parent < 0) continue;
    auto& outer = k[static_cast<std::size_t>(l.parent)].lambda;
    outer = Space::sum(outer, Space::to_parent(l, k[i].before, k[i].lambda));
  }
  return true;
}

/// plus[i] = p_i⁺ of the same step, docs/theory.md (6.7). Requires `after` to be set.
template <class Space>
void lie_right_momenta(const typename Space::Chain& chain, LieScratch<Space>& k,
                       const double* delta, double h, double* plus) noexcept {
  using Form = SpatialForm<Space>;
  for (auto& link : k)
    link.lambda = Form::from_space(
        InverseExp(link.x).transposed(Form::to_space(link.momentum), -1.0), &link.lambda);
  for (std::size_t i = k.size(); i-- > 0;) {
    const auto& l = chain.links[i];
    plus[i] = Space::along_axis(l, k[i].lambda) + delta[i] / h * l.armature;
    if (l.parent < 0) continue;
    auto& outer = k[static_cast<std::size_t>(l.parent)].lambda;
    outer = Space::sum(outer, Space::to_parent(l, k[i].after, k[i].lambda));
  }
}

/// Factors the linearisation of lie_left_momenta at its last Δ, docs/theory.md (6.14), (6.15).
/// Requires `after` to be set for this Δ. `damping` may be null. False if a pivot is lost.
template <class Space>
[[nodiscard]] bool lie_factor(const typename Space::Chain& chain, LieScratch<Space>& k, double h,
                              const double* damping) noexcept {
  using Form = SpatialForm<Space>;
  for (std::size_t i = 0; i < k.size(); ++i) {
    auto& link = k[i];
    link.after_kept = link.after;
    link.P = Form::stiffness(InverseExp(link.x), chain.links[i], Form::to_space(link.momentum), h);
  }
  for (std::size_t i = k.size(); i-- > 0;) {
    const auto& l = chain.links[i];
    auto& link = k[i];
    const auto A = Space::axis(l);
    link.u = Space::times(link.P, A);
    link.w = Space::transposed_times(link.P, A);
    const double along = Space::along_axis(l, link.u);
    const double d = along + l.armature / h + (damping != nullptr ? 0.5 * damping[i] : 0.0);
    if (!(std::abs(d) > 1e-14 * std::abs(along)) || !std::isfinite(d)) return false;
    link.inv_d = 1.0 / d;
    if (l.parent < 0) continue;
    auto rest = link.P;
    Space::subtract_outer(rest, link.u, Space::scaled(link.w, link.inv_d));
    Space::add(k[static_cast<std::size_t>(l.parent)].P,
               Form::to_parent(l, link.before, link.after, rest));
  }
  return true;
}

/// δΔ for a residual by the kept factors, docs/theory.md (6.16), (6.17).
template <class Space>
void lie_correct(const typename Space::Chain& chain, LieScratch<Space>& k, const double* residual,
                 double* delta) noexcept {
  for (auto& link : k) link.s = Space::zero_force();
  for (std::size_t i = k.size(); i-- > 0;) {
    const auto& l = chain.links[i];
    auto& link = k[i];
    link.r = (-residual[i] - Space::along_axis(l, link.s)) * link.inv_d;
    if (l.parent < 0) continue;
    auto& outer = k[static_cast<std::size_t>(l.parent)].s;
    outer = Space::sum(
        outer, Space::to_parent(l, link.before, Space::sum(link.s, Space::scaled(link.u, link.r))));
  }
  for (std::size_t i = 0; i < k.size(); ++i) {
    const auto& l = chain.links[i];
    auto& link = k[i];
    auto eta = l.parent < 0
                   ? Space::zero_motion()
                   : Space::to_child(l, link.after_kept, k[static_cast<std::size_t>(l.parent)].eta);
    delta[i] = link.r - Space::pair(eta, link.w) * link.inv_d;
    Space::add_along_axis(l, eta, delta[i]);
    link.eta = eta;
  }
}

}  // namespace hamelin::integration::kernel

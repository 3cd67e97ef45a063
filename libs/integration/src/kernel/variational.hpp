#pragma once
#include <cmath>
#include <vector>

#include "hamelin/dynamics/kernel/planar.hpp"
#include "hamelin/dynamics/kernel/spatial.hpp"
#include "hamelin/dynamics/kernel/sweeps.hpp"

/// The two sweeps of hamel-variational and their exact linearisation (SPEC §3), over the group and the scalar.
namespace hamelin::integration::kernel {

template <class Space>
struct VariationalLink {
  typename Space::Placement x{};
  typename Space::Motion carried{};  ///< X_i = Ad(g⁻¹) ξ_{i−1}
  typename Space::Motion b{};        ///< b_i = ad(X_i) A_i
  typename Space::Motion twist{};    ///< ξ_i
  typename Space::Motion step{};     ///< δξ_i
  typename Space::Force lambda{};    ///< λ_i

  // Factors of the linearisation, kept while momenta() moves on.
  typename Space::Placement x_kept{};
  typename Space::Motion a{}, B{};  ///< a_i, B_i
  typename Space::Force w{}, u{};   ///< w_i, u_i
  typename Space::Operator P{};     ///< δλ_i = P_i δξ_i + s_i
  typename Space::Scalar inv_d{};

  typename Space::Force s{};  ///< s_i of the current right-hand side
  typename Space::Scalar r{};
};

template <class Space>
using VariationalScratch = std::vector<VariationalLink<Space>>;

/// Both sweeps at θ_mid with velocity Δ/h: minus[i] = p_k⁻ and plus[i] = p_{k+1}⁺ without forces and potentials.
template <class Space>
void momenta(const typename Space::Chain& chain, VariationalScratch<Space>& k, const double* mid, const double* rate,
             double h, double* minus, double* plus) noexcept {
  for (std::size_t i = 0; i < k.size(); ++i) {
    const auto& l = chain.links[i];
    auto& link = k[i];
    link.x = Space::place(l, mid[i]);
    link.carried =
        l.parent < 0 ? Space::zero_motion() : Space::to_child(l, link.x, k[static_cast<std::size_t>(l.parent)].twist);
    link.b = Space::ad(link.carried, Space::axis(l));
    link.twist = link.carried;
    Space::add_along_axis(l, link.twist, rate[i]);
    link.lambda = Space::momentum(l, link.twist);
  }
  for (std::size_t i = k.size(); i-- > 0;) {
    const auto& l = chain.links[i];
    const auto& link = k[i];
    const double along = Space::along_axis(l, link.lambda), turned = 0.5 * h * Space::pair(link.b, link.lambda);
    minus[i] = along - turned;
    plus[i] = along + turned;
    if (l.parent < 0) continue;
    auto& outer = k[static_cast<std::size_t>(l.parent)].lambda;
    outer = Space::sum(outer, Space::to_parent(l, link.x, link.lambda));
  }
}

/// Factors the linearisation at the point of the last momenta(): eliminates from the tip with δλ_i = P_i δξ_i + s_i.
/// `damping` (null = none) adds D_i/2 to the pivots. False where a pivot vanishes.
template <class Space>
bool factor(const typename Space::Chain& chain, VariationalScratch<Space>& k, double h,
            const double* damping) noexcept {
  const double half = 0.5 * h;
  for (std::size_t i = 0; i < k.size(); ++i) k[i].P = Space::general(Space::rigid(chain.links[i]));
  for (std::size_t i = k.size(); i-- > 0;) {
    const auto& l = chain.links[i];
    auto& link = k[i];
    const auto A = Space::axis(l);
    link.x_kept = link.x;
    link.a = Space::sum(A, Space::scaled(link.b, -half));
    link.B = Space::sum(Space::scaled(A, 1.0 / h), Space::scaled(link.b, 0.5));
    const auto z = Space::ad_T(A, link.lambda);
    const auto PB = Space::times(link.P, link.B);
    link.w = Space::sum(Space::transposed_times(link.P, link.a), Space::scaled(z, half));
    link.u = Space::sum(PB, Space::scaled(z, -0.5));
    double d = Space::pair(link.a, PB) + 0.5 * half * Space::pair(link.b, z);
    if (damping != nullptr) d += 0.5 * damping[i];
    // A pivot is an inertia over h; one that is lost in the rounding of its terms has no meaning.
    if (!(std::abs(d) > 1e-14 * std::abs(Space::along_axis(l, PB)))) return false;
    link.inv_d = 1.0 / d;
    if (l.parent < 0) continue;
    auto rest = link.P;
    Space::subtract_outer(rest, link.u, Space::scaled(link.w, link.inv_d));
    Space::add(k[static_cast<std::size_t>(l.parent)].P, Space::to_parent(l, link.x, rest));
  }
  return true;
}

/// δΔ of the factored linearisation for a residual: s inwards, then outwards.
template <class Space>
void correct(const typename Space::Chain& chain, VariationalScratch<Space>& k, const double* residual,
             double* delta) noexcept {
  for (auto& link : k) link.s = Space::zero_force();
  for (std::size_t i = k.size(); i-- > 0;) {
    const auto& l = chain.links[i];
    auto& link = k[i];
    link.r = (-residual[i] - Space::pair(link.a, link.s)) * link.inv_d;
    if (l.parent < 0) continue;
    auto& outer = k[static_cast<std::size_t>(l.parent)].s;
    const auto carried = Space::sum(link.s, Space::scaled(link.u, link.r));
    outer = Space::sum(outer, Space::to_parent(l, link.x_kept, carried));
  }
  for (std::size_t i = 0; i < k.size(); ++i) {
    const auto& l = chain.links[i];
    auto& link = k[i];
    const auto y = l.parent < 0 ? Space::zero_motion()
                                : Space::to_child(l, link.x_kept, k[static_cast<std::size_t>(l.parent)].step);
    delta[i] = link.r - Space::pair(y, link.w) * link.inv_d;
    link.step = Space::sum(y, Space::scaled(link.B, delta[i]));
  }
}

}  // namespace hamelin::integration::kernel

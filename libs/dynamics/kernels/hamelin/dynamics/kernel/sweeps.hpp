#pragma once
#include <cstddef>

#include "hamelin/dynamics/kernel/lanes.hpp"

/// The recursive algorithms as templates over the group (kernel/spatial.hpp, kernel/planar.hpp) and
/// the scalar. Links are stored from the root on, and each is the parent of the next, so what a
/// sweep passes from link to link stays in registers. Outwards means from the root to the tip,
/// inwards the reverse. Each sweep reads all numbers of its arguments before it writes the first
/// result, so that results may share memory with arguments.
namespace hamelin::dynamics::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

/// Scratch memory of one link. The comment of each sweep says which members it uses.
template <class Space>
struct LinkScratch {
  typename Space::Placement x;
  typename Space::Motion motion;
  typename Space::Force force, column;
  typename Space::Direction down;
  typename Space::Scalar inv_d, u;
};

/// Scratch memory of a chain, laid out in memory that the caller owns. Nothing here allocates.
template <class Space>
struct Scratch {
  using S = typename Space::Scalar;

  LinkScratch<Space>* links;
  S *angle, *sine, *cosine;  ///< their sizes are multiples of native_lanes

  static constexpr std::size_t alignment = 64;
  HAMELIN_INLINE static std::size_t bytes(std::size_t n) noexcept {
    return 3 * padded(n) * sizeof(S) + n * sizeof(LinkScratch<Space>);
  }
  HAMELIN_INLINE static Scratch at(void* memory, std::size_t n) noexcept {
    S* const numbers = static_cast<S*>(memory);
    for (std::size_t i = n; i < padded(n); ++i) numbers[i] = S(0.0);
    return {reinterpret_cast<LinkScratch<Space>*>(numbers + 3 * padded(n)), numbers,
            numbers + padded(n), numbers + 2 * padded(n)};
  }
  HAMELIN_INLINE LinkScratch<Space>& operator[](std::size_t i) const noexcept { return links[i]; }
};

/// The links of a chain, and their number.
template <class Space>
HAMELIN_INLINE const typename Space::Link* links_of(const typename Space::Chain& chain) noexcept {
  return chain.links.data();
}
template <class Space>
HAMELIN_INLINE std::size_t count(const typename Space::Chain& chain) noexcept {
  return chain.links.size();
}

/// Computes the placements of all frames at q: the factors of docs/theory.md (1.16).
template <class Space>
HAMELIN_INLINE void place(const typename Space::Chain& chain, const Scratch<Space>& k,
                          const typename Space::Scalar* q) noexcept {
  using S = typename Space::Scalar;
  const std::size_t n = count<Space>(chain);
  const auto* const links = links_of<Space>(chain);
  for (std::size_t i = 0; i < n; ++i) k.angle[i] = Space::angle(links[i], q[i]);
  if constexpr (Space::root_axes)
    for (std::size_t i = 1; i < n; ++i) k.angle[i] += k.angle[i - 1];
  sincos(n, k.angle, k.sine, k.cosine);
  for (std::size_t i = 0; i < n; ++i) {
    if constexpr (Space::root_axes)
      Space::place(links[i], i > 0 ? k.sine[i - 1] : S(0.0), i > 0 ? k.cosine[i - 1] : S(1.0),
                   k.sine[i], k.cosine[i], k[i].x);
    else
      Space::place(links[i], q[i], k.sine[i], k.cosine[i], k[i].x);
  }
}

/// Newton–Euler outwards, docs/theory.md (2.10), (2.11): force[i] is the wrench that moves link i
/// alone. v and a may be null, which means zero. Keeps a in u[] for gather_forces.
template <class Space>
HAMELIN_INLINE void inertial_forces(const typename Space::Chain& chain, const Scratch<Space>& k,
                                    const typename Space::Scalar* v,
                                    const typename Space::Scalar* a) noexcept {
  using S = typename Space::Scalar;
  const auto* const links = links_of<Space>(chain);
  auto flow = Space::root_flow(chain);
  for (std::size_t i = 0; i < count<Space>(chain); ++i) {
    flow = Space::advance(links[i], k[i].x, flow, v == nullptr ? S(0.0) : v[i],
                          a == nullptr ? S(0.0) : a[i]);
    if constexpr (Space::has_prismatic_or_rotor)
      if (a != nullptr) k[i].u = a[i];
    k[i].force = Space::inertial_force(links[i], k[i].x, flow);
  }
}

/// Sums force[] from the tip inwards, sets tau[i] = A_i · f_i and, if `rotors`, adds their part,
/// armature · u[]: docs/theory.md (2.9). The rates are read from u[] because tau may have taken the
/// place of the argument that they came from.
template <class Space>
HAMELIN_INLINE void gather_forces(const typename Space::Chain& chain, const Scratch<Space>& k,
                                  bool rotors, typename Space::Scalar* tau) noexcept {
  const auto* const links = links_of<Space>(chain);
  auto carried = Space::zero_force();
  for (std::size_t i = count<Space>(chain); i-- > 0;) {
    const auto& l = links[i];
    const auto f = Space::sum(k[i].force, carried);
    tau[i] = Space::along_axis(l, f);
    if constexpr (Space::has_prismatic_or_rotor)
      if (rotors) tau[i] += k[i].u * l.armature;
    if (i > 0) carried = Space::to_parent(l, k[i].x, f);
  }
}

template <class Space>
void inverse_dynamics(const typename Space::Chain& chain, const Scratch<Space>& k,
                      const typename Space::Scalar* q, const typename Space::Scalar* v,
                      const typename Space::Scalar* a, typename Space::Scalar* tau) noexcept {
  place(chain, k, q);
  inertial_forces(chain, k, v, a);
  gather_forces(chain, k, a != nullptr, tau);
}

/// One link of the articulated-body recursion, docs/theory.md (2.12), (2.13). On entry P is the
/// articulated inertia of the links outboard, on return that of this link and the links outboard,
/// in the parent's frame. inv_d[i] is 1/d with d = A·P A + armature; column[i] is P A/d in the
/// link's frame, or, for parallel frames, about the parent's origin, which shortens the chain of
/// dependent operations.
template <class Space>
HAMELIN_INLINE void articulate(const typename Space::Link& l, LinkScratch<Space>& link, bool root,
                               typename Space::Inertia& P) noexcept {
  using S = typename Space::Scalar;
  Space::add_rigid(l, link.x, P);
  S d = Space::pivot(l, P);
  if constexpr (Space::has_prismatic_or_rotor) d += l.armature;
  link.inv_d = S(1.0) / d;
  link.column = Space::scaled(Space::column(l, P), link.inv_d);
  if (root) return;
  Space::carry(l, link.x, P, link.column, link.inv_d);
  if constexpr (Space::root_axes) link.column = Space::to_parent(l, link.x, link.column);
}

/// One link of the solve, docs/theory.md (2.14). On entry bias is the wrench of the links outboard,
/// on return that of this link and the links outboard, in the parent's frame. u[i] = (y −
/// A·bias)/d.
template <class Space>
HAMELIN_INLINE void eliminate(const typename Space::Link& l, LinkScratch<Space>& link, bool root,
                              typename Space::Scalar y, typename Space::Force& bias) noexcept {
  const auto left = y - Space::along_axis(l, bias);
  link.u = left * link.inv_d;
  if (root) return;
  if constexpr (Space::root_axes)
    bias = Space::sum(Space::to_parent(l, link.x, bias), Space::scaled(link.column, left));
  else
    bias = Space::to_parent(l, link.x, Space::sum(bias, Space::scaled(link.column, left)));
}

/// The outward sweep after the elimination, docs/theory.md (2.15). Computes x[i] and the twists ξ_i
/// whose joint rates are x, and calls visit(i, X_i) with X_i = Ad(g⁻¹) ξ_{i−1}, the twist before
/// the joint's own rate is added.
template <class Space, class Visit>
HAMELIN_INLINE void substitute(const typename Space::Chain& chain, const Scratch<Space>& k,
                               typename Space::Scalar* x, Visit&& visit) noexcept {
  const auto* const links = links_of<Space>(chain);
  auto twist = Space::zero_motion();
  for (std::size_t i = 0; i < count<Space>(chain); ++i) {
    const auto& l = links[i];
    const auto& link = k[i];
    auto m = i == 0 ? twist : Space::to_child(l, link.x, twist);
    if constexpr (Space::root_axes)
      x[i] = Space::minus_pair(link.u, twist, link.column);
    else
      x[i] = link.u - Space::pair(m, link.column);
    visit(i, m);
    Space::add_along_axis(l, m, x[i]);
    twist = m;
  }
}

/// Articulated inertias inwards, stored for solve_factored. Requires the placements of place().
template <class Space>
HAMELIN_INLINE void factor(const typename Space::Chain& chain, const Scratch<Space>& k) noexcept {
  auto P = Space::no_inertia();
  for (std::size_t i = count<Space>(chain); i-- > 0;)
    articulate<Space>(links_of<Space>(chain)[i], k[i], i == 0, P);
}

/// x = M⁻¹ y, after factor(). x and y may be the same.
template <class Space>
HAMELIN_INLINE void solve_factored(const typename Space::Chain& chain, const Scratch<Space>& k,
                                   const typename Space::Scalar* y,
                                   typename Space::Scalar* x) noexcept {
  auto bias = Space::zero_force();
  for (std::size_t i = count<Space>(chain); i-- > 0;)
    eliminate<Space>(links_of<Space>(chain)[i], k[i], i == 0, y[i], bias);
  substitute<Space>(chain, k, x, [](std::size_t, const auto&) {});
}

/// a = M⁻¹(τ − C v − ∂U): Newton–Euler bias outwards, articulated bodies inwards, accelerations
/// outwards.
template <class Space>
void forward_dynamics(const typename Space::Chain& chain, const Scratch<Space>& k,
                      const typename Space::Scalar* q, const typename Space::Scalar* v,
                      const typename Space::Scalar* tau, typename Space::Scalar* a) noexcept {
  place(chain, k, q);
  inertial_forces(chain, k, v, static_cast<const typename Space::Scalar*>(nullptr));
  auto P = Space::no_inertia();
  auto bias = Space::zero_force();
  for (std::size_t i = count<Space>(chain); i-- > 0;) {
    const auto& l = links_of<Space>(chain)[i];
    articulate<Space>(l, k[i], i == 0, P);
    bias = Space::sum(bias, k[i].force);
    eliminate<Space>(l, k[i], i == 0, tau[i], bias);
  }
  substitute<Space>(chain, k, a, [](std::size_t, const auto&) {});
}

template <class Space>
void solve_mass(const typename Space::Chain& chain, const Scratch<Space>& k,
                const typename Space::Scalar* q, const typename Space::Scalar* y,
                typename Space::Scalar* x) noexcept {
  place(chain, k, q);
  auto P = Space::no_inertia();
  auto bias = Space::zero_force();
  for (std::size_t i = count<Space>(chain); i-- > 0;) {
    const auto& l = links_of<Space>(chain)[i];
    articulate<Space>(l, k[i], i == 0, P);
    eliminate<Space>(l, k[i], i == 0, y[i], bias);
  }
  substitute<Space>(chain, k, x, [](std::size_t, const auto&) {});
}

/// Hamilton's equations for the momenta p = M v, docs/theory.md (2.16), (2.17): v = M⁻¹ p by
/// articulated bodies, then
///   ṗ_i = λ_i · ad(X_i) A_i − ∂U_i  with  λ_i = I_i ξ_i + Adᵀ λ_{i+1}.
/// The first term is −∂(½ pᵀM⁻¹p)/∂q_i. No Newton–Euler bias is needed, so this costs less than
/// forward dynamics. Stores the twists ξ_i in motion[].
template <class Space>
HAMELIN_INLINE void hamilton(const typename Space::Chain& chain, const Scratch<Space>& k,
                             const typename Space::Scalar* q, const typename Space::Scalar* p,
                             typename Space::Scalar* v, typename Space::Scalar* p_rate) noexcept {
  place(chain, k, q);
  const auto* const links = links_of<Space>(chain);
  const std::size_t n = count<Space>(chain);
  auto P = Space::no_inertia();
  auto bias = Space::zero_force();
  for (std::size_t i = n; i-- > 0;) {
    articulate<Space>(links[i], k[i], i == 0, P);
    eliminate<Space>(links[i], k[i], i == 0, p[i], bias);
  }
  auto down = Space::gravity(chain);
  substitute<Space>(chain, k, v, [&](std::size_t i, const auto& X) {
    down = Space::to_child(links[i], k[i].x, down);
    k[i].down = down;
    k[i].motion = X;
  });
  auto lambda = Space::zero_force();
  auto moment = Space::no_moment();
  for (std::size_t i = n; i-- > 0;) {
    const auto& l = links[i];
    const auto X = k[i].motion;
    Space::add_along_axis(l, k[i].motion, v[i]);
    lambda = Space::sum(lambda, Space::momentum(l, k[i].x, k[i].motion));
    Space::add(moment, Space::moment(l, k[i].x));
    p_rate[i] = Space::coriolis_torque(l, X, lambda) + Space::gravity_torque(l, k[i].down, moment);
    if (i == 0) break;
    lambda = Space::to_parent(l, k[i].x, lambda);
    moment = Space::to_parent(l, k[i].x, moment);
  }
}

/// A gyroscopic term for the sweeps: the point in the link's joint-aligned frame, w in the root's
/// axes.
struct Spin {
  std::size_t link;
  geometry::Vec3<double> point, w;
};

/// Joint torques Σ J_pᵀ (w × J_p v) of gyroscopic terms, where J_p is the Jacobian of a term's
/// point, docs/theory.md (2.22). Requires the placements of place() and the twists in motion[].
template <class Space>
HAMELIN_INLINE void gyroscopic_torque(const typename Space::Chain& chain, const Scratch<Space>& k,
                                      const Spin* spins, std::size_t count_spins,
                                      typename Space::Scalar* tau) noexcept {
  const auto* const links = links_of<Space>(chain);
  const std::size_t n = count<Space>(chain);
  for (std::size_t i = 0; i < n; ++i) k[i].force = Space::zero_force();
  for (std::size_t s = 0; s < count_spins; ++s) {
    const Spin& spin = spins[s];
    auto w = Space::spin_axis(spin.w);
    for (std::size_t i = 0; i <= spin.link; ++i) w = Space::to_child_axis(links[i], k[i].x, w);
    auto& total = k[spin.link].force;
    total =
        Space::sum(total, Space::spin_force(w, k[spin.link].x, spin.point, k[spin.link].motion));
  }
  gather_forces(chain, k, false, tau);
}

/// ∂U(q), docs/theory.md (2.7).
template <class Space>
void gravity_torque(const typename Space::Chain& chain, const Scratch<Space>& k,
                    const typename Space::Scalar* q, typename Space::Scalar* tau) noexcept {
  place(chain, k, q);
  const auto* const links = links_of<Space>(chain);
  const std::size_t n = count<Space>(chain);
  auto down = Space::gravity(chain);
  for (std::size_t i = 0; i < n; ++i) k[i].down = down = Space::to_child(links[i], k[i].x, down);
  auto moment = Space::no_moment();
  for (std::size_t i = n; i-- > 0;) {
    Space::add(moment, Space::moment(links[i], k[i].x));
    tau[i] = -Space::gravity_torque(links[i], k[i].down, moment);
    if (i > 0) moment = Space::to_parent(links[i], k[i].x, moment);
  }
}

/// Body twists into motion[i], docs/theory.md (2.1). Requires the placements of place(). Keeps v in
/// u[] for gather_forces.
template <class Space>
HAMELIN_INLINE void twists(const typename Space::Chain& chain, const Scratch<Space>& k,
                           const typename Space::Scalar* v) noexcept {
  const auto* const links = links_of<Space>(chain);
  auto m = Space::zero_motion();
  for (std::size_t i = 0; i < count<Space>(chain); ++i) {
    if (i > 0) m = Space::to_child(links[i], k[i].x, m);
    Space::add_along_axis(links[i], m, v[i]);
    k[i].motion = m;
    if constexpr (Space::has_prismatic_or_rotor) k[i].u = v[i];
  }
}

/// p = M v, docs/theory.md (2.5).
template <class Space>
void momentum(const typename Space::Chain& chain, const Scratch<Space>& k,
              const typename Space::Scalar* q, const typename Space::Scalar* v,
              typename Space::Scalar* p) noexcept {
  place(chain, k, q);
  twists(chain, k, v);
  for (std::size_t i = 0; i < count<Space>(chain); ++i)
    k[i].force = Space::momentum(links_of<Space>(chain)[i], k[i].x, k[i].motion);
  gather_forces(chain, k, true, p);
}

template <class Space>
typename Space::Scalar kinetic_energy(const typename Space::Chain& chain, const Scratch<Space>& k,
                                      const typename Space::Scalar* q,
                                      const typename Space::Scalar* v) noexcept {
  using S = typename Space::Scalar;
  place(chain, k, q);
  twists(chain, k, v);
  S twice = S(0.0);
  for (std::size_t i = 0; i < count<Space>(chain); ++i) {
    const auto& l = links_of<Space>(chain)[i];
    twice += Space::pair(k[i].motion, Space::momentum(l, k[i].x, k[i].motion));
    if constexpr (Space::has_prismatic_or_rotor) twice += v[i] * v[i] * l.armature;
  }
  return S(0.5) * twice;
}

/// −Σ m g·(position − root), from masses and first moments summed inwards: docs/theory.md (2.6).
template <class Space>
typename Space::Scalar potential_energy(const typename Space::Chain& chain, const Scratch<Space>& k,
                                        const typename Space::Scalar* q) noexcept {
  place(chain, k, q);
  auto moment = Space::no_moment();
  for (std::size_t i = count<Space>(chain); i-- > 0;) {
    const auto& l = links_of<Space>(chain)[i];
    Space::add(moment, Space::moment(l, k[i].x));
    moment = Space::to_parent(l, k[i].x, moment);
  }
  return Space::potential(chain, moment);
}

/// Composite inertias inwards, and one column of M per link: docs/theory.md (2.18), (2.19). `M` is
/// column-major with leading dimension `ld`.
template <class Space>
void mass_matrix(const typename Space::Chain& chain, const Scratch<Space>& k,
                 const typename Space::Scalar* q, typename Space::Scalar* M,
                 std::size_t ld) noexcept {
  place(chain, k, q);
  const auto* const links = links_of<Space>(chain);
  const std::size_t n = count<Space>(chain);
  auto composite = Space::no_inertia();
  for (std::size_t i = n; i-- > 0;) {
    Space::add_rigid(links[i], k[i].x, composite);
    auto f = Space::column(links[i], composite);
    for (std::size_t j = i;; --j) {
      M[i * ld + j] = M[j * ld + i] = Space::along_axis(links[j], f);
      if (j == 0) break;
      f = Space::to_parent(links[j], k[j].x, f);
    }
    if constexpr (Space::has_prismatic_or_rotor) M[i * ld + i] += links[i].armature;
    if (i > 0) composite = Space::to_parent(links[i], k[i].x, composite);
  }
}

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::dynamics::kernel

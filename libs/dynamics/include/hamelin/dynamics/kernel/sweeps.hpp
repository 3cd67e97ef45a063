#pragma once
#include <cstddef>
#include <vector>

/// The recursive algorithms, written once over the group (kernel/spatial.hpp, kernel/planar.hpp) and the scalar.
/// Links come parents first; outward sweeps read the parent's entry, inward sweeps add to it.
namespace hamelin::dynamics::kernel {

/// Scratch of one link. Which members hold what is said at each sweep.
template <class Space>
struct LinkScratch {
  typename Space::Placement x{};
  typename Space::Flow flow{};
  typename Space::Motion motion{};
  typename Space::Force force{}, column{};
  typename Space::Inertia inertia{};
  typename Space::Moment moment{};
  typename Space::Scalar inv_d{}, u{};
};

template <class Space>
using Scratch = std::vector<LinkScratch<Space>>;

/// Places all frames at q.
template <class Space>
void place(const typename Space::Chain& chain, Scratch<Space>& k, const typename Space::Scalar* q) noexcept {
  for (std::size_t i = 0; i < k.size(); ++i) k[i].x = Space::place(chain.links[i], q[i]);
}

/// Newton–Euler outwards (5): force[i] = the wrench link i needs for itself. v, a may be null (zero).
template <class Space>
void inertial_forces(const typename Space::Chain& chain, Scratch<Space>& k, const typename Space::Scalar* v,
                     const typename Space::Scalar* a) noexcept {
  using S = typename Space::Scalar;
  const auto root = Space::root_flow(chain);
  for (std::size_t i = 0; i < k.size(); ++i) {
    const auto& l = chain.links[i];
    const auto& parent = l.parent < 0 ? root : k[static_cast<std::size_t>(l.parent)].flow;
    k[i].flow = Space::advance(l, k[i].x, parent, v == nullptr ? S(0) : v[i], a == nullptr ? S(0) : a[i]);
    k[i].force = Space::inertial_force(l, k[i].flow);
  }
}

/// (8) inwards: sums force[] from the tips and reads tau[i] = A_i · f_i, (6).
template <class Space>
void gather_forces(const typename Space::Chain& chain, Scratch<Space>& k, typename Space::Scalar* tau) noexcept {
  for (std::size_t i = k.size(); i-- > 0;) {
    const auto& l = chain.links[i];
    tau[i] = Space::along_axis(l, k[i].force);
    if (l.parent < 0) continue;
    auto& outer = k[static_cast<std::size_t>(l.parent)].force;
    outer = Space::sum(outer, Space::to_parent(l, k[i].x, k[i].force));
  }
}

template <class Space>
void inverse_dynamics(const typename Space::Chain& chain, Scratch<Space>& k, const typename Space::Scalar* q,
                      const typename Space::Scalar* v, const typename Space::Scalar* a,
                      typename Space::Scalar* tau) noexcept {
  place(chain, k, q);
  inertial_forces(chain, k, v, a);
  gather_forces(chain, k, tau);
}

/// Articulated inertias inwards: inertia[i], column[i] = P A, inv_d[i] = 1/(A·PA). Placements must stand.
template <class Space>
void factor(const typename Space::Chain& chain, Scratch<Space>& k) noexcept {
  using S = typename Space::Scalar;
  for (std::size_t i = 0; i < k.size(); ++i) k[i].inertia = Space::rigid(chain.links[i]);
  for (std::size_t i = k.size(); i-- > 0;) {
    const auto& l = chain.links[i];
    k[i].column = Space::column(l, k[i].inertia);
    k[i].inv_d = S(1) / Space::along_axis(l, k[i].column);
    if (l.parent < 0) continue;
    auto rest = k[i].inertia;
    Space::subtract_outer(rest, k[i].column, k[i].inv_d);
    Space::add(k[static_cast<std::size_t>(l.parent)].inertia, Space::to_parent(l, k[i].x, rest));
  }
}

/// x = M⁻¹(y − gathered force[]), after factor. force[] is consumed; set it to zero for a plain solve.
template <class Space>
void solve_factored(const typename Space::Chain& chain, Scratch<Space>& k, const typename Space::Scalar* y,
                    typename Space::Scalar* x) noexcept {
  for (std::size_t i = k.size(); i-- > 0;) {
    const auto& l = chain.links[i];
    k[i].u = (y[i] - Space::along_axis(l, k[i].force)) * k[i].inv_d;
    if (l.parent < 0) continue;
    const auto carried = Space::sum(k[i].force, Space::scaled(k[i].column, k[i].u));
    auto& outer = k[static_cast<std::size_t>(l.parent)].force;
    outer = Space::sum(outer, Space::to_parent(l, k[i].x, carried));
  }
  for (std::size_t i = 0; i < k.size(); ++i) {
    const auto& l = chain.links[i];
    auto m =
        l.parent < 0 ? Space::zero_motion() : Space::to_child(l, k[i].x, k[static_cast<std::size_t>(l.parent)].motion);
    x[i] = k[i].u - k[i].inv_d * Space::pair(m, k[i].column);
    Space::add_along_axis(l, m, x[i]);
    k[i].motion = m;
  }
}

template <class Space>
void forward_dynamics(const typename Space::Chain& chain, Scratch<Space>& k, const typename Space::Scalar* q,
                      const typename Space::Scalar* v, const typename Space::Scalar* tau,
                      typename Space::Scalar* a) noexcept {
  place(chain, k, q);
  inertial_forces(chain, k, v, static_cast<const typename Space::Scalar*>(nullptr));
  factor(chain, k);
  solve_factored(chain, k, tau, a);
}

template <class Space>
void solve_mass(const typename Space::Chain& chain, Scratch<Space>& k, const typename Space::Scalar* q,
                const typename Space::Scalar* y, typename Space::Scalar* x) noexcept {
  place(chain, k, q);
  factor(chain, k);
  for (auto& link : k) link.force = Space::zero_force();
  solve_factored(chain, k, y, x);
}

/// Body twists (5) at placements that stand: motion[i].
template <class Space>
void twists(const typename Space::Chain& chain, Scratch<Space>& k, const typename Space::Scalar* v) noexcept {
  for (std::size_t i = 0; i < k.size(); ++i) {
    const auto& l = chain.links[i];
    auto m =
        l.parent < 0 ? Space::zero_motion() : Space::to_child(l, k[i].x, k[static_cast<std::size_t>(l.parent)].motion);
    Space::add_along_axis(l, m, v[i]);
    k[i].motion = m;
  }
}

/// p = M v; leaves the momentum of each link's outboard part in force[].
template <class Space>
void momentum(const typename Space::Chain& chain, Scratch<Space>& k, const typename Space::Scalar* q,
              const typename Space::Scalar* v, typename Space::Scalar* p) noexcept {
  place(chain, k, q);
  twists(chain, k, v);
  for (std::size_t i = 0; i < k.size(); ++i) k[i].force = Space::momentum(chain.links[i], k[i].motion);
  gather_forces(chain, k, p);
}

template <class Space>
typename Space::Scalar kinetic_energy(const typename Space::Chain& chain, Scratch<Space>& k,
                                      const typename Space::Scalar* q, const typename Space::Scalar* v) noexcept {
  using S = typename Space::Scalar;
  place(chain, k, q);
  twists(chain, k, v);
  S twice = S(0);
  for (std::size_t i = 0; i < k.size(); ++i)
    twice += Space::pair(k[i].motion, Space::momentum(chain.links[i], k[i].motion));
  return S(0.5) * twice;
}

/// −Σ m g·(position − root): mass moments gathered inwards.
template <class Space>
typename Space::Scalar potential_energy(const typename Space::Chain& chain, Scratch<Space>& k,
                                        const typename Space::Scalar* q) noexcept {
  using S = typename Space::Scalar;
  place(chain, k, q);
  for (std::size_t i = 0; i < k.size(); ++i) k[i].moment = Space::moment(chain.links[i]);
  S energy = S(0);
  for (std::size_t i = k.size(); i-- > 0;) {
    const auto& l = chain.links[i];
    const auto carried = Space::to_parent(l, k[i].x, k[i].moment);
    if (l.parent < 0)
      energy += Space::potential(chain, carried);
    else
      Space::add(k[static_cast<std::size_t>(l.parent)].moment, carried);
  }
  return energy;
}

/// Composite inertias inwards, then one column of M a link; `M` is column-major with leading dimension `ld`.
template <class Space>
void mass_matrix(const typename Space::Chain& chain, Scratch<Space>& k, const typename Space::Scalar* q,
                 typename Space::Scalar* M, std::size_t ld) noexcept {
  using S = typename Space::Scalar;
  place(chain, k, q);
  for (std::size_t i = 0; i < k.size(); ++i) k[i].inertia = Space::rigid(chain.links[i]);
  for (std::size_t i = k.size(); i-- > 0;) {
    const auto& l = chain.links[i];
    for (std::size_t j = 0; j < k.size(); ++j) M[i * ld + j] = S(0);
    if (l.parent >= 0)
      Space::add(k[static_cast<std::size_t>(l.parent)].inertia, Space::to_parent(l, k[i].x, k[i].inertia));
  }
  for (std::size_t i = 0; i < k.size(); ++i) {
    auto f = Space::column(chain.links[i], k[i].inertia);
    for (std::size_t j = i;;) {
      const auto& l = chain.links[j];
      M[i * ld + j] = M[j * ld + i] = Space::along_axis(l, f);
      if (l.parent < 0) break;
      f = Space::to_parent(l, k[j].x, f);
      j = static_cast<std::size_t>(l.parent);
    }
  }
}

}  // namespace hamelin::dynamics::kernel

#pragma once
#include <concepts>

namespace hamelin::geometry {

/// The common interface of SO(2), SO(3), SE(2) and SE(3), for functions written once over the group
/// G. The recursive kernels of libs/dynamics do not use it: they have types of their own.
///
/// A value of G is a displacement. `Tangent` is a twist, and also the type of wrenches and momenta:
/// a plain Eigen vector of size `dof`, angular part first. `Adjoint` is a dof × dof matrix, `Point`
/// a point of the space that is moved, `Matrix` the group's own matrices. `dexp` is
/// right-trivialised: d/dt exp(x) = hat(dexp(x) ẋ) exp(x), docs/theory.md (1.5).
template <class G>
concept LieGroup = std::regular<G> &&
    requires(const G g, const typename G::Tangent x, const typename G::Point point,
             const typename G::Matrix m) {
  { G::dof } -> std::convertible_to<int>;
  { g* g } -> std::same_as<G>;
  { g* point } -> std::same_as<typename G::Point>;
  { g.act(point) } -> std::same_as<typename G::Point>;
  { g.inverse() } -> std::same_as<G>;
  { g.log() } -> std::same_as<typename G::Tangent>;
  { g.matrix() } -> std::convertible_to<typename G::Matrix>;
  { g.Ad() } -> std::convertible_to<typename G::Adjoint>;
  { g.Ad(x) } -> std::same_as<typename G::Tangent>;
  { g.Ad_T(x) } -> std::same_as<typename G::Tangent>;
  { G::exp(x) } -> std::same_as<G>;
  { G::ad(x) } -> std::same_as<typename G::Adjoint>;
  { G::ad(x, x) } -> std::same_as<typename G::Tangent>;
  { G::ad_T(x, x) } -> std::same_as<typename G::Tangent>;
  { G::dexp(x) } -> std::same_as<typename G::Adjoint>;
  { G::dexp_inv(x) } -> std::same_as<typename G::Adjoint>;
  { G::hat(x) } -> std::same_as<typename G::Matrix>;
  { G::vee(m) } -> std::same_as<typename G::Tangent>;
};

}  // namespace hamelin::geometry

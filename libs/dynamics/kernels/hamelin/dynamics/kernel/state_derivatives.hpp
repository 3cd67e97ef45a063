#pragma once
#include <cstddef>

#include "hamelin/dynamics/kernel/derivatives.hpp"

/// Derivatives of inverse and forward dynamics at many states, docs/theory.md (2.24)–(2.29): S is
/// Lanes, with one state per lane. Matrices are column-major without padding.
namespace hamelin::dynamics::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

template <class S>
struct ScrewList {
  Screw<S>* list;
  HAMELIN_INLINE const Screw<S>& at(std::size_t j) const noexcept { return list[j]; }
  HAMELIN_INLINE void set(std::size_t j, const Screw<S>& s) const noexcept { list[j] = s; }
};

/// Scratch of a chain in memory that the caller owns.
template <class S>
struct StateDerivativeScratch {
  std::size_t n;
  ScrewList<S> screw, first, second;
  Outboard<S>* outboard;

  HAMELIN_INLINE static std::size_t bytes(std::size_t n) noexcept {
    return n * (3 * sizeof(Screw<S>) + sizeof(Outboard<S>));
  }
  HAMELIN_INLINE static StateDerivativeScratch at(void* memory, std::size_t n) noexcept {
    auto* const screws = static_cast<Screw<S>*>(memory);
    return {n,
            {screws},
            {screws + n},
            {screws + 2 * n},
            reinterpret_cast<Outboard<S>*>(screws + 3 * n)};
  }
};

/// Where the derivatives of inverse dynamics by q, v and a go: store(matrix, i, j, number) with
/// matrix 0, 1 and 2. docs/theory.md (2.28)
template <class S, class Store>
HAMELIN_INLINE void sweep_inwards(const StateDerivativeScratch<S>& k, const DerivativeLink* links,
                                  const Store& store) noexcept {
  for (std::size_t i = k.n; i-- > 0;) {
    const JointWrenches<S> w =
        wrenches_of(k.outboard[i], k.screw.at(i), k.first.at(i), k.second.at(i));
    const Screw<S> twice = w.inertial * S(2.0);
    for (std::size_t j = 0; j <= i; ++j) {
      const Screw<S>&screw = k.screw.at(j), &first = k.first.at(j);
      const S inertia = dot(screw, w.inertial);
      store(0, i, j, dot(first.a, w.row) + dot(k.second.at(j), w.inertial));
      store(1, i, j, dot(screw.a, w.row) + dot(first, twice));
      if (j == i) {
        store(2, i, i, inertia + S(links[i].armature));
        break;
      }
      store(0, j, i, dot(screw, w.by_q));
      store(1, j, i, dot(screw, w.by_v));
      store(2, i, j, inertia);
      store(2, j, i, inertia);
    }
    if (i > 0) k.outboard[i - 1] = k.outboard[i - 1] + k.outboard[i];
  }
}

/// Inverts symmetric positive definite matrices in place by symmetric Gauss–Jordan elimination
/// (sweeps; Goodnight 1979), which needs the entries on and below the diagonal only; at the end
/// they are copied above it. `pivot` is scratch memory of n numbers.
template <class S>
HAMELIN_INLINE void invert_symmetric(std::size_t n, S* A, S* pivot) noexcept {
  for (std::size_t k = 0; k < n; ++k) {
    const S inverse = S(1.0) / A[k + k * n];
    for (std::size_t i = 0; i < k; ++i) pivot[i] = A[k + i * n];
    for (std::size_t i = k; i < n; ++i) pivot[i] = A[i + k * n];
    for (std::size_t j = 0; j < n; ++j) {
      const S factor = pivot[j] * inverse;
      S* const column = A + j * n;
      for (std::size_t i = j; i < n; ++i) column[i] -= pivot[i] * factor;
    }
    for (std::size_t i = 0; i < k; ++i) A[k + i * n] = pivot[i] * inverse;
    for (std::size_t i = k; i < n; ++i) A[i + k * n] = pivot[i] * inverse;
    A[k + k * n] = -inverse;
  }
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t i = j; i < n; ++i) A[j + i * n] = A[i + j * n] = -A[i + j * n];
}

/// store(0, …) −A B and store(1, …) −A C, all n × n, A symmetric: docs/theory.md (2.29). Two rows
/// at once, since each number of A, B and C is then read for two products.
template <class S, class Store>
HAMELIN_INLINE void minus_products(std::size_t n, const S* A, const S* B, const S* C,
                                   const Store& store) noexcept {
  for (std::size_t k = 0; k < n; ++k) {
    const S *const b = B + k * n, *const c = C + k * n;
    for (std::size_t i = 0; i < n; i += 2) {
      // the rows of a symmetric matrix are its columns
      const S *const even = A + i * n, *const odd = i + 1 < n ? even + n : even;
      S sum[4] = {S(0.0), S(0.0), S(0.0), S(0.0)};
      for (std::size_t j = 0; j < n; ++j) {
        sum[0] -= even[j] * b[j];
        sum[1] -= odd[j] * b[j];
        sum[2] -= even[j] * c[j];
        sum[3] -= odd[j] * c[j];
      }
      store(0, i, k, sum[0]);
      store(1, i, k, sum[2]);
      if (i + 1 == n) break;
      store(0, i + 1, k, sum[1]);
      store(1, i + 1, k, sum[3]);
    }
  }
}

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::dynamics::kernel

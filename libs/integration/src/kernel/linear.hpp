#pragma once
#include <cstddef>

#include "hamelin/dynamics/kernel/lanes.hpp"

/// Dense linear algebra on rows whose length is a multiple of `row_multiple`.
namespace hamelin::integration::kernel {

using dynamics::kernel::padded;
using dynamics::kernel::row_multiple;

struct LinearKernels {
  /// Solves S X = R for the n rows of [S | R], each of padded(n) + `columns` numbers, by Gaussian
  /// elimination with partial pivoting. @param rows row i begins at rows + i · stride; afterwards
  /// its part from padded(n) on is row i of X @param columns multiple of row_multiple @param
  /// factors scratch memory of n · row_multiple numbers
  /// @return false if a pivot is zero or X is not finite
  bool (*solve)(std::size_t n, std::size_t columns, double* rows, std::size_t stride,
                double* factors) noexcept;
  /// C −= A B for `rows` rows of A and C, and `inner` rows of B.
  void (*subtract_product)(std::size_t rows, std::size_t inner, std::size_t columns,
                           const double* A, std::size_t a_stride, const double* B,
                           std::size_t b_stride, double* C, std::size_t c_stride) noexcept;
  /// out = Σ_k weights[k] terms[k] for matrices of `rows` rows of padded(size) numbers each.
  void (*combine)(std::size_t count, const double* const* terms, const double* weights,
                  std::size_t rows, std::size_t size, std::size_t term_stride, double* out,
                  std::size_t out_stride) noexcept;
};

inline namespace HAMELIN_ISA_NAMESPACE {

using Pack = dynamics::kernel::Lanes<dynamics::kernel::native_lanes>;
inline constexpr auto pack_size = static_cast<std::size_t>(dynamics::kernel::native_lanes);

/// `count` ≤ 4 rows of C −= A B.
template <std::size_t count>
HAMELIN_INLINE void subtract_rows(std::size_t inner, std::size_t columns, const double* A,
                                  std::size_t a_stride, const double* B, std::size_t b_stride,
                                  double* C, std::size_t c_stride) noexcept {
  for (std::size_t j = 0; j < columns; j += pack_size) {
    Pack sum[count];
    for (std::size_t i = 0; i < count; ++i) sum[i] = Pack::load(C + i * c_stride + j);
    for (std::size_t k = 0; k < inner; ++k) {
      const Pack b = Pack::load(B + k * b_stride + j);
      for (std::size_t i = 0; i < count; ++i) sum[i] -= Pack(A[i * a_stride + k]) * b;
    }
    for (std::size_t i = 0; i < count; ++i) sum[i].store(C + i * c_stride + j);
  }
}

HAMELIN_INLINE void subtract_product(std::size_t rows, std::size_t inner, std::size_t columns,
                                     const double* A, std::size_t a_stride, const double* B,
                                     std::size_t b_stride, double* C,
                                     std::size_t c_stride) noexcept {
  std::size_t i = 0;
  for (; i + 4 <= rows; i += 4)
    subtract_rows<4>(inner, columns, A + i * a_stride, a_stride, B, b_stride, C + i * c_stride,
                     c_stride);
  for (; i < rows; ++i)
    subtract_rows<1>(inner, columns, A + i * a_stride, a_stride, B, b_stride, C + i * c_stride,
                     c_stride);
}

HAMELIN_INLINE void combine(std::size_t count, const double* const* terms, const double* weights,
                            std::size_t rows, std::size_t size, std::size_t term_stride,
                            double* out, std::size_t out_stride) noexcept {
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t j = 0; j < size; j += pack_size) {
      Pack sum(0.0);
      for (std::size_t k = 0; k < count; ++k)
        sum += Pack(weights[k]) * Pack::load(terms[k] + i * term_stride + j);
      sum.store(out + i * out_stride + j);
    }
}

HAMELIN_INLINE void swap_rows(double* a, double* b, std::size_t size) noexcept {
  for (std::size_t j = 0; j < size; j += pack_size) {
    const Pack kept = Pack::load(a + j);
    Pack::load(b + j).store(a + j);
    kept.store(b + j);
  }
}

/// The equations of one call of solve(): row i begins at row(i), factors of elimination at
/// factor(i).
struct Equations {
  double* rows;
  std::size_t stride, n, end;
  double* factors;

  [[nodiscard]] HAMELIN_INLINE double* row(std::size_t i) const noexcept {
    return rows + i * stride;
  }
  [[nodiscard]] HAMELIN_INLINE double* factor(std::size_t i) const noexcept {
    return factors + i * row_multiple;
  }
};

HAMELIN_INLINE void pivot_rows(const Equations& e, std::size_t k) noexcept {
  std::size_t largest = k;
  double size = __builtin_fabs(e.row(k)[k]);
  for (std::size_t i = k + 1; i < e.n; ++i) {
    const double x = __builtin_fabs(e.row(i)[k]);
    largest = x > size ? i : largest;
    size = x > size ? x : size;
  }
  if (largest == k) return;
  swap_rows(e.row(k), e.row(largest), e.end);
  swap_rows(e.factor(k), e.factor(largest), row_multiple);
}

/// Eliminates the columns first … last, but only in the packets of these columns.
/// @return false if a pivot is zero or not a number
HAMELIN_INLINE bool factor_panel(const Equations& e, std::size_t first, std::size_t last) noexcept {
  constexpr std::size_t packs = row_multiple / pack_size;
  for (std::size_t k = first; k < last; ++k) {
    pivot_rows(e, k);
    const double pivot = e.row(k)[k];
    if (!(__builtin_fabs(pivot) > 0.0)) return false;
    const double inverse = 1.0 / pivot;
    Pack from[packs];
    for (std::size_t p = 0; p < packs; ++p) from[p] = Pack::load(e.row(k) + first + p * pack_size);
    for (std::size_t i = k + 1; i < e.n; ++i) {
      double* const row = e.row(i) + first;
      const double factor = row[k - first] * inverse;
      e.factor(i)[k - first] = factor;
      // what this leaves left of column k + 1 is not read any more
      for (std::size_t p = 0; p < packs; ++p)
        (Pack::load(row + p * pack_size) - Pack(factor) * from[p]).store(row + p * pack_size);
    }
  }
  return true;
}

/// Elimination by panels, so that a packet is loaded and stored once per panel.
HAMELIN_INLINE bool eliminate(const Equations& e) noexcept {
  for (std::size_t first = 0; first < e.n; first += row_multiple) {
    const std::size_t next = first + row_multiple, last = next < e.n ? next : e.n;
    if (!factor_panel(e, first, last)) return false;
    for (std::size_t i = first + 1; i < last; ++i)
      subtract_rows<1>(i - first, e.end - next, e.factor(i), row_multiple, e.row(first) + next,
                       e.stride, e.row(i) + next, e.stride);
    subtract_product(e.n - last, last - first, e.end - next, e.factor(last), row_multiple,
                     e.row(first) + next, e.stride, e.row(last) + next, e.stride);
  }
  return true;
}

/// The rows of a panel of the back substitution. @return zero in all lanes if they are finite
HAMELIN_INLINE Pack substitute_panel(const Equations& e, std::size_t first,
                                     std::size_t last) noexcept {
  const std::size_t right = padded(e.n);
  Pack check(0.0);
  for (std::size_t k = last; k-- > first;) {
    const Pack inverse(1.0 / e.row(k)[k]);
    for (std::size_t j = right; j < e.end; j += pack_size) {
      const Pack x = Pack::load(e.row(k) + j) * inverse;
      check += x - x;
      x.store(e.row(k) + j);
    }
    subtract_product(k - first, 1, e.end - right, e.row(first) + k, e.stride, e.row(k) + right,
                     e.stride, e.row(first) + right, e.stride);
  }
  return check;
}

HAMELIN_INLINE bool solve(std::size_t n, std::size_t columns, double* rows, std::size_t stride,
                          double* factors) noexcept {
  const std::size_t right = padded(n);
  const Equations e{rows, stride, n, right + columns, factors};
  if (!eliminate(e)) return false;
  Pack check(0.0);
  for (std::size_t last = n; last > 0;) {
    const std::size_t first = (last - 1) / row_multiple * row_multiple;
    check += substitute_panel(e, first, last);
    subtract_product(first, last - first, columns, e.row(0) + first, stride, e.row(first) + right,
                     stride, e.row(0) + right, stride);
    last = first;
  }
  return dynamics::kernel::largest(dynamics::kernel::abs(check)) == 0.0;
}

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::integration::kernel

#pragma once
#include <cstddef>
#include <utility>

#include "hamelin/dynamics/kernel/lanes.hpp"

/// Dense linear algebra on rows whose length is a multiple of `row_multiple`.
namespace hamelin::integration::kernel {

inline constexpr std::size_t row_multiple = 8;
[[nodiscard]] constexpr std::size_t padded(std::size_t n) noexcept {
  return (n + row_multiple - 1) / row_multiple * row_multiple;
}

struct LinearKernels {
  /// Solves S X = R for the n rows of [S | R], each of padded(n) + `columns` numbers, by Gaussian
  /// elimination with partial pivoting. @param rows their order is changed; afterwards the part of
  /// rows[i] from padded(n) on is row i of X @param columns multiple of row_multiple
  /// @return false if a pivot is zero or not finite
  bool (*solve)(std::size_t n, std::size_t columns, double* const* rows, double** order) noexcept;
  /// C += A B for `rows` rows of A and C, and `inner` rows of B.
  void (*add_product)(std::size_t rows, std::size_t inner, std::size_t columns, const double* A,
                      std::size_t a_stride, const double* B, std::size_t b_stride, double* C,
                      std::size_t c_stride) noexcept;
};

inline namespace HAMELIN_ISA_NAMESPACE {

using Pack = dynamics::kernel::Lanes<dynamics::kernel::native_lanes>;
inline constexpr auto pack_size = static_cast<std::size_t>(dynamics::kernel::native_lanes);

/// rows[i] −= factor[i] · pivot for `count` ≤ 4 rows, from column `begin` to `end`.
template <std::size_t count>
HAMELIN_INLINE void subtract(double* const* rows, const double* factor, const double* pivot,
                             std::size_t begin, std::size_t end) noexcept {
  Pack f[count];
  for (std::size_t i = 0; i < count; ++i) f[i] = Pack(factor[i]);
  for (std::size_t j = begin; j < end; j += pack_size) {
    const Pack p = Pack::load(pivot + j);
    for (std::size_t i = 0; i < count; ++i) (Pack::load(rows[i] + j) - f[i] * p).store(rows[i] + j);
  }
}

/// The same for rows[first … last), with the factors column `k` of the rows times `scale`.
HAMELIN_INLINE void eliminate(double* const* rows, std::size_t first, std::size_t last,
                              std::size_t k, double scale, std::size_t begin,
                              std::size_t end) noexcept {
  const double* const pivot = rows[k];
  std::size_t i = first;
  for (; i + 4 <= last; i += 4) {
    const double factor[] = {rows[i][k] * scale, rows[i + 1][k] * scale, rows[i + 2][k] * scale,
                             rows[i + 3][k] * scale};
    subtract<4>(rows + i, factor, pivot, begin, end);
  }
  for (; i < last; ++i) {
    const double factor = rows[i][k] * scale;
    subtract<1>(rows + i, &factor, pivot, begin, end);
  }
}

HAMELIN_INLINE bool solve(std::size_t n, std::size_t columns, double* const* given,
                          double** rows) noexcept {
  const std::size_t right = padded(n), end = right + columns;
  for (std::size_t i = 0; i < n; ++i) rows[i] = given[i];
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t largest = k;
    for (std::size_t i = k + 1; i < n; ++i)
      if (__builtin_fabs(rows[i][k]) > __builtin_fabs(rows[largest][k])) largest = i;
    std::swap(rows[k], rows[largest]);
    const double pivot = rows[k][k];
    if (!(__builtin_fabs(pivot) > 0.0)) return false;
    // a packet begins left of column k + 1, where nothing is read any more but column k itself
    const std::size_t begin = (k + 1) / pack_size * pack_size;
    eliminate(rows, k + 1, n, k, 1.0 / pivot, begin, end);
  }
  for (std::size_t k = n; k-- > 0;) {
    const Pack inverse(1.0 / rows[k][k]);
    for (std::size_t j = right; j < end; j += pack_size)
      (Pack::load(rows[k] + j) * inverse).store(rows[k] + j);
    eliminate(rows, 0, k, k, 1.0, right, end);
  }
  return true;
}

/// `count` ≤ 4 rows of C += A B.
template <std::size_t count>
HAMELIN_INLINE void add_rows(std::size_t inner, std::size_t columns, const double* A,
                             std::size_t a_stride, const double* B, std::size_t b_stride, double* C,
                             std::size_t c_stride) noexcept {
  for (std::size_t j = 0; j < columns; j += pack_size) {
    Pack sum[count];
    for (std::size_t i = 0; i < count; ++i) sum[i] = Pack::load(C + i * c_stride + j);
    for (std::size_t k = 0; k < inner; ++k) {
      const Pack b = Pack::load(B + k * b_stride + j);
      for (std::size_t i = 0; i < count; ++i) sum[i] += Pack(A[i * a_stride + k]) * b;
    }
    for (std::size_t i = 0; i < count; ++i) sum[i].store(C + i * c_stride + j);
  }
}

HAMELIN_INLINE void add_product(std::size_t rows, std::size_t inner, std::size_t columns,
                                const double* A, std::size_t a_stride, const double* B,
                                std::size_t b_stride, double* C, std::size_t c_stride) noexcept {
  std::size_t i = 0;
  for (; i + 4 <= rows; i += 4)
    add_rows<4>(inner, columns, A + i * a_stride, a_stride, B, b_stride, C + i * c_stride,
                c_stride);
  for (; i < rows; ++i)
    add_rows<1>(inner, columns, A + i * a_stride, a_stride, B, b_stride, C + i * c_stride,
                c_stride);
}

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::integration::kernel

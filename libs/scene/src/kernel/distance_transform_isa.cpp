// Compiled once for each instruction set; see dynamics/kernel/lanes.hpp on what may be used here.
#include "hamelin/scene/kernel/distance_transform.hpp"

#include "hamelin/geometry/small.hpp"

namespace hamelin::scene::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

namespace {

#if defined(__AVX2__)
constexpr int lanes = 16;
#else
constexpr int lanes = 8;
#endif
using Lanes [[gnu::vector_size(2 * lanes)]] = std::int16_t;

HAMELIN_INLINE Lanes load(const std::int16_t* from) {
  Lanes x;
  __builtin_memcpy(&x, from, sizeof x);
  return x;
}
HAMELIN_INLINE Lanes min(Lanes a, Lanes b) {
  return a < b ? a : b;
}
HAMELIN_INLINE bool any_above(Lanes x, std::int16_t bound) {
  const Lanes above = x > bound - Lanes{};
#if defined(__AVX2__)
  using Bytes [[gnu::vector_size(32)]] = char;
  return __builtin_ia32_pmovmskb256(reinterpret_cast<Bytes>(above)) != 0;
#elif defined(__SSE2__)
  using Bytes [[gnu::vector_size(16)]] = char;
  return __builtin_ia32_pmovmskb128(reinterpret_cast<Bytes>(above)) != 0;
#else
  bool any = false;
  for (int i = 0; i < lanes; ++i) any = any || above[i] != 0;
  return any;
#endif
}

// A row farther away than the root of the largest value so far cannot lower any.
HAMELIN_INLINE Lanes lowest(const std::int16_t* in, int row, int rows, std::ptrdiff_t stride,
                            int cap) {
  Lanes least = load(in);
  for (int k = 1; k < cap; ++k) {
    const auto square = static_cast<std::int16_t>(k * k);
    if (!any_above(least, square)) break;
    const bool before = row >= k, behind = row + k < rows;
    if (!before && !behind) break;
    const Lanes x = load(before ? in - k * stride : in + k * stride);
    const Lanes y = load(behind ? in + k * stride : in - k * stride);
    least = min(least, min(x, y) + square);
  }
  return least;
}

void add_axis(const std::int16_t* in, std::int16_t* out, int rows, int first, int count,
              std::ptrdiff_t in_stride, std::ptrdiff_t out_stride, int width, int cap) noexcept {
  for (int row = first; row < first + count; ++row)
    for (int at = 0; at < width; at += lanes) {
      const int x = at + lanes <= width ? at : width - lanes;  // the last ones again
      const Lanes least = lowest(in + row * in_stride + x, row, rows, in_stride, cap);
      __builtin_memcpy(out + (row - first) * out_stride + x, &least, sizeof least);
    }
}

}  // namespace

extern const TransformKernels transform_kernels;
constexpr TransformKernels transform_kernels{add_axis};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::scene::kernel

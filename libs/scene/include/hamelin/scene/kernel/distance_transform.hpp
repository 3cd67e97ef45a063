#pragma once
#include <cstddef>
#include <cstdint>

namespace hamelin::scene::kernel {

/// One pass of a distance transform, compiled for each instruction set. It works on integers, so
/// all instruction sets give the same bits.
struct TransformKernels {
  /// out[i] = min over |k| < cap of in[first + i + k] + k², for each element of rows that are added
  /// as wholes, docs/theory.md (17.6). `in` and `out` do not overlap.
  /// @param rows number of rows of `in` @param first, count the rows whose sums are written
  /// @param in_stride, out_stride elements from row to row
  /// @param width elements of a row, at least 16
  void (*add_axis)(const std::int16_t* in, std::int16_t* out, int rows, int first, int count,
                   std::ptrdiff_t in_stride, std::ptrdiff_t out_stride, int width,
                   int cap) noexcept;
};

}  // namespace hamelin::scene::kernel

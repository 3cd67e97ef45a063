#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

namespace hamelin::sensing::kernel {

/// A ray whose first voxel is within a box, see Ray; bits are those of the box's voxels.
struct BoxRay {
  std::array<double, 3> next, apart;
  double length;
  std::int64_t bit;  ///< of the first voxel
  std::array<std::int64_t, 3> bit_step;
  std::int64_t end_bit;  ///< of the voxel of the end; −1 if that is outside of the box
  /// Steps until it leaves the box, one less along each axis: packed(…), see left_box.
  std::int64_t left;
  std::array<std::int64_t, 3> left_step;

  /// One number for three below 2²⁰.
  [[nodiscard]] static constexpr std::int64_t packed(std::int64_t x, std::int64_t y,
                                                     std::int64_t z) noexcept {
    return x + (y << 21) + (z << 42);
  }
};

/// Bits of BoxRay::left that are set when one of the three has become −1 by steps of one.
inline constexpr std::int64_t left_box = BoxRay::packed(1 << 20, 1 << 20, 1 << 20);

struct WalkKernels {
  /// Sets the bits of all voxels that rays pass before that of their end and within the box.
  /// @param rays of which none ends in its first voxel
  void (*walk)(const BoxRay* rays, std::size_t count, std::uint64_t* bits) noexcept;
};

}  // namespace hamelin::sensing::kernel

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
  std::int64_t way;  ///< to the voxel of the end: packed(end − voxel)
  std::array<std::int64_t, 3> way_step;
  std::array<std::int64_t, 3> left;  ///< steps until it leaves the box; positive

  /// One number for differences of less than 2¹⁹ voxels along each axis.
  [[nodiscard]] static constexpr std::int64_t packed(std::int64_t x, std::int64_t y,
                                                     std::int64_t z) noexcept {
    return x + (y * 1048576) + (z * 1048576 * 1048576);
  }
};

struct WalkKernels {
  /// Sets the bits of all voxels that rays pass before that of their end and within the box.
  /// @param rays of which none ends in its first voxel
  void (*walk)(const BoxRay* rays, std::size_t count, std::uint64_t* bits) noexcept;
};

}  // namespace hamelin::sensing::kernel

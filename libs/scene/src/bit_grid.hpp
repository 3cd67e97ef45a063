#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "hamelin/scene/boxes.hpp"

namespace hamelin::scene {

/// Voxels are drawn tile by tile: cubes of so many voxels along each axis. That is a multiple of
/// the size of every small cell, so no cell is in two tiles.
inline constexpr std::int32_t tile = 256;

/// Where the tile of a voxel begins, along an axis.
[[nodiscard]] inline std::int32_t first_of_tile(std::int32_t voxel) {
  return (voxel + (1 << 20)) / tile * tile - (1 << 20);
}

/// Bits of one tile, or of its first layers along z, x running fastest.
class BitGrid {
 public:
  explicit BitGrid(std::size_t layers = tile) : words_(layers * tile * words_per_row) {}

  void set_row(std::int32_t x0, std::int32_t x1, std::int32_t y, std::int32_t z) {
    each_word(x0, x1, y, z, [](std::uint64_t& word, std::uint64_t bits) {
      word |= bits;
      return true;
    });
  }
  void clear_row(std::int32_t x0, std::int32_t x1, std::int32_t y, std::int32_t z) {
    each_word(x0, x1, y, z, [](std::uint64_t& word, std::uint64_t bits) {
      word &= ~bits;
      return true;
    });
  }
  [[nodiscard]] bool row_is_full(std::int32_t x0, std::int32_t x1, std::int32_t y, std::int32_t z) {
    return each_word(x0, x1, y, z,
                     [](std::uint64_t& word, std::uint64_t bits) { return (word & bits) == bits; });
  }
  /// The first set x from x0 on, or `tile`.
  [[nodiscard]] std::int32_t next(std::int32_t x0, std::int32_t y, std::int32_t z) {
    for (std::int32_t x = x0; x < tile;) {
      const std::uint64_t rest = word(x, y, z) >> (static_cast<unsigned>(x) % 64U);
      if (rest != 0) return x + std::countr_zero(rest);
      x = (x / 64 + 1) * 64;
    }
    return tile;
  }

 private:
  static constexpr std::size_t words_per_row = tile / 64;
  /// Calls f with each word that the run [x0, x1) touches and with the bits of the run in it, until
  /// f returns false.
  template <class F>
  bool each_word(std::int32_t x0, std::int32_t x1, std::int32_t y, std::int32_t z, const F& f) {
    for (std::int32_t x = x0; x < x1;) {
      const std::int32_t end = std::min(x1, (x / 64 + 1) * 64);
      const std::uint64_t bits = ~std::uint64_t{0} >> static_cast<unsigned>(64 - (end - x));
      if (!f(word(x, y, z), bits << (static_cast<unsigned>(x) % 64U))) return false;
      x = end;
    }
    return true;
  }
  std::uint64_t& word(std::int32_t x, std::int32_t y, std::int32_t z) {
    const auto row = static_cast<std::size_t>(z) * tile + static_cast<std::size_t>(y);
    return words_[row * words_per_row + static_cast<std::size_t>(x) / 64];
  }
  std::vector<std::uint64_t> words_;
};

/// Calls f(x0, x1, y, z) for each row of a part of a tile.
template <class F>
void each_row(const VoxelBox& part, const std::array<std::int32_t, 3>& origin, const F& f) {
  for (std::int32_t z = part.lo[2]; z < part.hi[2]; ++z)
    for (std::int32_t y = part.lo[1]; y < part.hi[1]; ++y)
      f(part.lo[0] - origin[0], part.hi[0] - origin[0], y - origin[1], z - origin[2]);
}

/// Extracts blocks from the grid, extended as far as possible in x, then in y, then in z. The grid
/// is empty afterwards.
/// @param used the part of the grid that may have bits
/// @param origin of the tile
/// @param boxes receives the blocks
void extract_blocks(BitGrid& grid, const VoxelBox& used, const std::array<std::int32_t, 3>& origin,
                    std::vector<VoxelBox>& boxes);

}  // namespace hamelin::scene

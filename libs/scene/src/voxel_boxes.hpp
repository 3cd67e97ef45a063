#pragma once
#include <algorithm>

#include "hamelin/scene/boxes.hpp"

namespace hamelin::scene {

[[nodiscard]] inline bool is_empty(const VoxelBox& box) {
  return box.lo[0] >= box.hi[0] || box.lo[1] >= box.hi[1] || box.lo[2] >= box.hi[2];
}

[[nodiscard]] inline VoxelBox common(const VoxelBox& a, const VoxelBox& b) {
  VoxelBox out;
  for (std::size_t i = 0; i < 3; ++i) {
    out.lo[i] = std::max(a.lo[i], b.lo[i]);
    out.hi[i] = std::min(a.hi[i], b.hi[i]);
  }
  return out;
}

/// The smallest box that contains both; empty ones do not count.
[[nodiscard]] inline VoxelBox hull(const VoxelBox& a, const VoxelBox& b) {
  if (is_empty(a)) return b;
  if (is_empty(b)) return a;
  VoxelBox out;
  for (std::size_t i = 0; i < 3; ++i) {
    out.lo[i] = std::min(a.lo[i], b.lo[i]);
    out.hi[i] = std::max(a.hi[i], b.hi[i]);
  }
  return out;
}

}  // namespace hamelin::scene

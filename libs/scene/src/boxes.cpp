#include "hamelin/scene/boxes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "bit_grid.hpp"
#include "voxel_boxes.hpp"

namespace hamelin::scene {

namespace {

// Joins boxes that share a whole face perpendicular to `axis`. Returns whether there were any.
bool join(std::vector<VoxelBox>& boxes, std::size_t axis) {
  const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
  // Cross section, then position along the axis, as integers that sort fast: a coordinate plus 2²⁰
  // fits into 21 bits.
  struct Key {
    std::uint64_t section, rest;
    std::uint32_t box;
    bool operator<(const Key& other) const {
      return section != other.section ? section < other.section : rest < other.rest;
    }
  };
  const auto bits = [](std::int32_t x) { return static_cast<std::uint64_t>(x + (1 << 20)); };
  std::vector<Key> keys(boxes.size());
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const VoxelBox& box = boxes[i];
    keys[i] = {bits(box.lo[u]) << 42U | bits(box.hi[u]) << 21U | bits(box.lo[v]),
               bits(box.hi[v]) << 21U | bits(box.lo[axis]), static_cast<std::uint32_t>(i)};
  }
  std::sort(keys.begin(), keys.end());
  std::vector<VoxelBox> joined;
  joined.reserve(boxes.size());
  for (std::size_t k = 0; k < keys.size(); ++k) {
    const VoxelBox& box = boxes[keys[k].box];
    if (k > 0 && keys[k - 1].section == keys[k].section &&
        keys[k - 1].rest >> 21U == keys[k].rest >> 21U && joined.back().hi[axis] == box.lo[axis]) {
      joined.back().hi[axis] = box.hi[axis];
    } else {
      joined.push_back(box);
    }
  }
  const bool any = joined.size() < boxes.size();
  boxes = std::move(joined);
  return any;
}

}  // namespace

std::size_t voxels_in(const std::vector<VoxelBox>& boxes) {
  std::size_t voxels = 0;
  for (const VoxelBox& box : boxes) {
    std::size_t product = 1;
    for (std::size_t axis = 0; axis < 3; ++axis)
      product *= static_cast<std::size_t>(box.hi[axis] - box.lo[axis]);
    voxels += product;
  }
  return voxels;
}

std::vector<VoxelBox> merge(const std::vector<Cell>& cells) {
  constexpr std::int32_t wide = 32;  // cells of this size and larger are boxes as they are
  std::vector<VoxelBox> boxes;
  std::map<std::array<std::int32_t, 3>, std::vector<Cell>> tiles;
  for (const Cell& cell : cells) {
    if (cell.size >= wide) {
      boxes.push_back(
          {cell.lo, {cell.lo[0] + cell.size, cell.lo[1] + cell.size, cell.lo[2] + cell.size}});
      continue;
    }
    std::array<std::int32_t, 3> origin{};
    for (std::size_t axis = 0; axis < 3; ++axis) origin[axis] = first_of_tile(cell.lo[axis]);
    tiles[origin].push_back(cell);
  }
  if (!tiles.empty()) {
    BitGrid grid;
    for (const auto& [origin, inside] : tiles) {
      VoxelBox used{{tile, tile, tile}, {0, 0, 0}};
      for (const Cell& cell : inside) {
        std::array<std::int32_t, 3> lo{};
        for (std::size_t axis = 0; axis < 3; ++axis) {
          lo[axis] = cell.lo[axis] - origin[axis];
          used.lo[axis] = std::min(used.lo[axis], lo[axis]);
          used.hi[axis] = std::max(used.hi[axis], lo[axis] + cell.size);
        }
        for (std::int32_t z = lo[2]; z < lo[2] + cell.size; ++z)
          for (std::int32_t y = lo[1]; y < lo[1] + cell.size; ++y)
            grid.set_row(lo[0], lo[0] + cell.size, y, z);
      }
      extract_blocks(grid, used, origin, boxes);
    }
  }
  join(boxes);  // blocks end at tiles and at wide cells
  return boxes;
}

void join(std::vector<VoxelBox>& boxes) {
  // done when no axis has joined any boxes since its last turn
  for (std::size_t axis = 0, idle = 0; idle < 3; axis = (axis + 1) % 3)
    idle = join(boxes, axis) ? 1 : idle + 1;
}

void subtract(std::vector<VoxelBox>& boxes, const VoxelBox& hole) {
  const std::size_t count = boxes.size();
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    VoxelBox rest = boxes[i];
    if (!overlap(rest, hole)) {
      boxes[kept++] = rest;
      continue;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (rest.lo[axis] < hole.lo[axis]) {
        VoxelBox piece = rest;
        piece.hi[axis] = rest.lo[axis] = hole.lo[axis];
        boxes.push_back(piece);
      }
      if (rest.hi[axis] > hole.hi[axis]) {
        VoxelBox piece = rest;
        piece.lo[axis] = rest.hi[axis] = hole.hi[axis];
        boxes.push_back(piece);
      }
    }
  }
  boxes.erase(boxes.begin() + static_cast<std::ptrdiff_t>(kept),
              boxes.begin() + static_cast<std::ptrdiff_t>(count));
}

std::vector<VoxelBox> without(const VoxelBox& box, std::span<const VoxelBox> holes) {
  constexpr std::size_t few = 8;
  std::vector<VoxelBox> rest{box};
  if (holes.size() <= few) {
    for (const VoxelBox& hole : holes) subtract(rest, hole);
    return rest;
  }
  // what is about the holes is cut out, drawn, and joined again
  VoxelBox about;
  for (const VoxelBox& hole : holes) about = hull(about, common(box, hole));
  subtract(rest, about);
  BitGrid grid;
  std::array<std::int32_t, 3> origin{};
  for (origin[2] = about.lo[2]; origin[2] < about.hi[2]; origin[2] += tile)
    for (origin[1] = about.lo[1]; origin[1] < about.hi[1]; origin[1] += tile)
      for (origin[0] = about.lo[0]; origin[0] < about.hi[0]; origin[0] += tile) {
        const VoxelBox window{origin, {origin[0] + tile, origin[1] + tile, origin[2] + tile}},
            part = common(about, window);
        each_row(part, origin, [&](auto... row) { grid.set_row(row...); });
        for (const VoxelBox& hole : holes)
          if (overlap(hole, part))
            each_row(common(hole, part), origin, [&](auto... row) { grid.clear_row(row...); });
        const VoxelBox used{
            {0, 0, 0}, {part.hi[0] - origin[0], part.hi[1] - origin[1], part.hi[2] - origin[2]}};
        extract_blocks(grid, used, origin, rest);
      }
  return rest;
}

Box to_metres(const VoxelBox& box, double resolution) {
  const auto corner = [&](const std::array<std::int32_t, 3>& c) {
    return Eigen::Vector3d{c[0] * resolution, c[1] * resolution, c[2] * resolution};
  };
  return {corner(box.lo), corner(box.hi)};
}

Box to_metres(const Cell& cell, double resolution) {
  return to_metres(
      VoxelBox{cell.lo, {cell.lo[0] + cell.size, cell.lo[1] + cell.size, cell.lo[2] + cell.size}},
      resolution);
}

VoxelBox to_voxels(const Box& box, double resolution) {
  VoxelBox voxels;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    voxels.lo[axis] = static_cast<std::int32_t>(std::lround(box.lo[a] / resolution));
    voxels.hi[axis] = static_cast<std::int32_t>(std::lround(box.hi[a] / resolution));
  }
  return voxels;
}

}  // namespace hamelin::scene

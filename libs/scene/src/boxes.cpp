#include "hamelin/scene/boxes.hpp"

#include <algorithm>
#include <bit>
#include <iterator>
#include <map>
#include <tuple>

namespace hamelin::scene {

namespace {

double squared_distance(const Eigen::Vector3d& p, const Box& box) {
  return (box.lo - p).cwiseMax(p - box.hi).cwiseMax(0.0).squaredNorm();
}

double squared_distance_to_farthest_corner(const Eigen::Vector3d& p, const Box& box) {
  return (p - box.lo).cwiseAbs().cwiseMax((box.hi - p).cwiseAbs()).squaredNorm();
}

void push_children(const Cell& cell, std::vector<Cell>& stack) {
  const std::int32_t size = cell.size / 2;
  for (unsigned child = 8; child-- > 0;) {
    Cell part{cell.lo, size};
    for (unsigned axis = 0; axis < 3; ++axis) part.lo[axis] += (child >> axis) & 1U ? size : 0;
    stack.push_back(part);
  }
}

constexpr std::int32_t tile = 256;  // voxels; a multiple of every small cell's size, so that none straddles tiles
constexpr std::int32_t wide = 32;   // cells from this size on are boxes already

// Bits of one tile, x running fastest.
class BitGrid {
 public:
  BitGrid() : words_(std::size_t{tile} * tile * words_per_row) {}

  void set_row(std::int32_t x0, std::int32_t x1, std::int32_t y, std::int32_t z) {
    for (std::int32_t x = x0; x < x1; ++x) word(x, y, z) |= bit(x);
  }
  void clear_row(std::int32_t x0, std::int32_t x1, std::int32_t y, std::int32_t z) {
    for (std::int32_t x = x0; x < x1; ++x) word(x, y, z) &= ~bit(x);
  }
  [[nodiscard]] bool row_is_full(std::int32_t x0, std::int32_t x1, std::int32_t y, std::int32_t z) {
    for (std::int32_t x = x0; x < x1; ++x)
      if ((word(x, y, z) & bit(x)) == 0) return false;
    return true;
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
  static std::uint64_t bit(std::int32_t x) { return std::uint64_t{1} << (static_cast<unsigned>(x) % 64U); }
  std::uint64_t& word(std::int32_t x, std::int32_t y, std::int32_t z) {
    const auto row = static_cast<std::size_t>(z) * tile + static_cast<std::size_t>(y);
    return words_[row * words_per_row + static_cast<std::size_t>(x) / 64];
  }
  std::vector<std::uint64_t> words_;
};

// Takes blocks out of the grid: as long in x as the run goes, then as far in y, then in z. Leaves the grid empty.
void take_blocks(BitGrid& grid, const VoxelBox& used, const std::array<std::int32_t, 3>& origin,
                 std::vector<VoxelBox>& boxes) {
  for (std::int32_t z = used.lo[2]; z < used.hi[2]; ++z) {
    for (std::int32_t y = used.lo[1]; y < used.hi[1]; ++y) {
      for (std::int32_t x = grid.next(used.lo[0], y, z); x < tile; x = grid.next(x, y, z)) {
        std::int32_t x1 = x + 1, y1 = y + 1, z1 = z + 1;
        while (x1 < used.hi[0] && grid.row_is_full(x1, x1 + 1, y, z)) ++x1;
        while (y1 < used.hi[1] && grid.row_is_full(x, x1, y1, z)) ++y1;
        const auto slice_is_full = [&](std::int32_t slice) {
          for (std::int32_t row = y; row < y1; ++row)
            if (!grid.row_is_full(x, x1, row, slice)) return false;
          return true;
        };
        while (z1 < used.hi[2] && slice_is_full(z1)) ++z1;
        for (std::int32_t slice = z; slice < z1; ++slice)
          for (std::int32_t row = y; row < y1; ++row) grid.clear_row(x, x1, row, slice);
        boxes.push_back(
            {{origin[0] + x, origin[1] + y, origin[2] + z}, {origin[0] + x1, origin[1] + y1, origin[2] + z1}});
      }
    }
  }
}

// Joins boxes that share a whole face across `axis`. Returns whether any were.
bool join(std::vector<VoxelBox>& boxes, std::size_t axis) {
  const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
  const auto cross_section = [&](const VoxelBox& box) { return std::tie(box.lo[u], box.hi[u], box.lo[v], box.hi[v]); };
  std::sort(boxes.begin(), boxes.end(), [&](const VoxelBox& a, const VoxelBox& b) {
    return std::tuple_cat(cross_section(a), std::tie(a.lo[axis])) <
           std::tuple_cat(cross_section(b), std::tie(b.lo[axis]));
  });
  std::vector<VoxelBox> joined;
  for (const VoxelBox& box : boxes) {
    if (!joined.empty() && cross_section(joined.back()) == cross_section(box) &&
        joined.back().hi[axis] == box.lo[axis]) {
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

std::vector<Cell> crop(const std::vector<Cell>& cells, double resolution, const Ball& ball) {
  std::vector<Cell> kept;
  std::copy_if(cells.begin(), cells.end(), std::back_inserter(kept), [&](const Cell& cell) {
    return squared_distance(ball.center, to_metres(cell, resolution)) <= ball.radius * ball.radius;
  });
  return kept;
}

std::vector<Cell> cut_out(const std::vector<Cell>& cells, double resolution, const Ball& ball) {
  std::vector<Cell> kept, stack(cells.rbegin(), cells.rend());
  while (!stack.empty()) {
    const Cell cell = stack.back();
    stack.pop_back();
    if (squared_distance(ball.center, to_metres(cell, resolution)) > ball.radius * ball.radius) {
      kept.push_back(cell);
    } else if (cell.size > 1) {
      push_children(cell, stack);
    }
  }
  return kept;
}

double volume_inside(const std::vector<Cell>& cells, double resolution, const Ball& ball) {
  double voxels = 0.0;
  const double radius2 = ball.radius * ball.radius;
  std::vector<Cell> stack(cells.rbegin(), cells.rend());
  while (!stack.empty()) {
    const Cell cell = stack.back();
    stack.pop_back();
    const Box box = to_metres(cell, resolution);
    if (squared_distance(ball.center, box) > radius2) continue;
    const double edge = cell.size;
    if (squared_distance_to_farthest_corner(ball.center, box) <= radius2) {
      voxels += edge * edge * edge;
    } else if (cell.size > 1) {
      push_children(cell, stack);
    } else if ((0.5 * (box.lo + box.hi) - ball.center).squaredNorm() <= radius2) {
      voxels += 1.0;
    }
  }
  return voxels * resolution * resolution * resolution;
}

std::vector<VoxelBox> merge(const std::vector<Cell>& cells) {
  std::vector<VoxelBox> boxes;
  std::map<std::array<std::int32_t, 3>, std::vector<Cell>> tiles;
  for (const Cell& cell : cells) {
    if (cell.size >= wide) {
      boxes.push_back({cell.lo, {cell.lo[0] + cell.size, cell.lo[1] + cell.size, cell.lo[2] + cell.size}});
      continue;
    }
    std::array<std::int32_t, 3> origin{};
    for (std::size_t axis = 0; axis < 3; ++axis) origin[axis] = (cell.lo[axis] + (1 << 20)) / tile * tile - (1 << 20);
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
          for (std::int32_t y = lo[1]; y < lo[1] + cell.size; ++y) grid.set_row(lo[0], lo[0] + cell.size, y, z);
      }
      take_blocks(grid, used, origin, boxes);
    }
  }
  // Blocks end at tiles and at wide cells; what still fits together is joined until nothing does.
  while (join(boxes, 0) || join(boxes, 1) || join(boxes, 2)) {
  }
  return boxes;
}

Box to_metres(const VoxelBox& box, double resolution) {
  const auto corner = [&](const std::array<std::int32_t, 3>& c) {
    return Eigen::Vector3d{c[0] * resolution, c[1] * resolution, c[2] * resolution};
  };
  return {corner(box.lo), corner(box.hi)};
}

Box to_metres(const Cell& cell, double resolution) {
  return to_metres(VoxelBox{cell.lo, {cell.lo[0] + cell.size, cell.lo[1] + cell.size, cell.lo[2] + cell.size}},
                   resolution);
}

}  // namespace hamelin::scene

#include "hamelin/scene/boxes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <iterator>
#include <map>

#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/scene/distance.hpp"
#include "voxel_boxes.hpp"

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

// Tells whether a box touches any of the capsules. Tests their bounding boxes first.
class CapsuleSet {
 public:
  explicit CapsuleSet(std::span<const Capsule> capsules) : capsules_(capsules) {
    for (const Capsule& c : capsules) {
      hulls_.push_back(
          {c.from.cwiseMin(c.to).array() - c.radius, c.from.cwiseMax(c.to).array() + c.radius});
      hull_ = {hull_.lo.cwiseMin(hulls_.back().lo), hull_.hi.cwiseMax(hulls_.back().hi)};
    }
  }

  [[nodiscard]] bool touches(const Box& box) const {
    if (apart(box, hull_)) return false;
    for (std::size_t i = 0; i < capsules_.size(); ++i) {
      const Capsule& c = capsules_[i];
      if (apart(box, hulls_[i])) continue;
      const bool touching = c.from == c.to ? squared_distance(c.from, box) <= c.radius * c.radius
                                           : closest_on_box(c.from, c.to, box).distance <= c.radius;
      if (touching) return true;
    }
    return false;
  }

 private:
  static bool apart(const Box& a, const Box& b) {
    return (a.lo.array() > b.hi.array()).any() || (b.lo.array() > a.hi.array()).any();
  }

  std::span<const Capsule> capsules_;
  std::vector<Box> hulls_;
  Box hull_{Eigen::Vector3d::Constant(infinity), Eigen::Vector3d::Constant(-infinity)};
};

// In voxels. A tile is a multiple of the size of every small cell, so no cell is in two tiles.
// Cells of size `wide` and larger are used as boxes.
constexpr std::int32_t tile = 256;
constexpr std::int32_t wide = 32;

std::int32_t first_of_tile(std::int32_t voxel) {
  return (voxel + (1 << 20)) / tile * tile - (1 << 20);
}

// Bits of one tile, or of its first layers along z, x running fastest.
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

// Extracts blocks from the grid, extended as far as possible in x, then in y, then in z. The grid
// is empty afterwards.
void extract_blocks(BitGrid& grid, const VoxelBox& used, const std::array<std::int32_t, 3>& origin,
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
        boxes.push_back({{origin[0] + x, origin[1] + y, origin[2] + z},
                         {origin[0] + x1, origin[1] + y1, origin[2] + z1}});
      }
    }
  }
}

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

/// The grains, cubes of so many voxels, whose centres are in a ball.
class GrainsInBall {
 public:
  GrainsInBall(const Ball& ball, std::int32_t grain, double resolution)
      : ball_(ball), grain_(grain), resolution_(resolution), radius2_(ball.radius * ball.radius) {}

  /// Whether the grain of this voxel is one.
  [[nodiscard]] bool contains(const std::array<std::int32_t, 3>& voxel) const {
    return squared(0, index(voxel[0])) + squared(1, index(voxel[1])) +
               squared(2, index(voxel[2])) <=
           radius2_;
  }

  /// Their volume in a cell that is larger than a grain, in voxels, column by column.
  [[nodiscard]] double volume(const Cell& cell) const {
    std::array<Range, 3> range;
    for (unsigned axis = 0; axis < 3; ++axis) {
      const std::int32_t first = index(cell.lo[axis]);
      range[axis] = within(axis, 0.0, {first, first + cell.size / grain_});
    }
    double count = 0.0;
    for (std::int32_t x = range[0].begin; x < range[0].end; ++x)
      for (std::int32_t y = range[1].begin; y < range[1].end; ++y) {
        const Range column = within(2, squared(0, x) + squared(1, y), range[2]);
        count += column.end - column.begin;
      }
    const double edge = grain_;
    return count * edge * edge * edge;
  }

 private:
  struct Range {
    std::int32_t begin, end;
  };

  [[nodiscard]] std::int32_t index(std::int32_t voxel) const {
    return (voxel & ~(grain_ - 1)) / grain_;
  }
  /// Square of the distance of a grain's centre from that of the ball along an axis.
  [[nodiscard]] double squared(unsigned axis, std::int32_t grain) const {
    const double lo = resolution_ * (grain * grain_), hi = resolution_ * ((grain + 1) * grain_);
    const double offset = 0.5 * (lo + hi) - ball_.center[axis];
    return offset * offset;
  }
  /// The part of a range of grains along an axis that is in the ball, given the squares along the
  /// other axes. The root gives its ends to rounding, the sum of squares decides.
  [[nodiscard]] Range within(unsigned axis, double others, Range range) const {
    const auto in = [&](std::int32_t grain) { return others + squared(axis, grain) <= radius2_; };
    const double edge = resolution_ * grain_, center = ball_.center[axis] / edge - 0.5,
                 half = std::sqrt(std::max(0.0, radius2_ - others)) / edge;
    const auto clamped = [&](double x) {
      return static_cast<std::int32_t>(
          std::clamp(x, static_cast<double>(range.begin), static_cast<double>(range.end)));
    };
    Range found{clamped(std::ceil(center - half)), clamped(std::floor(center + half) + 1.0)};
    while (found.begin > range.begin && in(found.begin - 1)) --found.begin;
    while (found.end < range.end && in(found.end)) ++found.end;
    while (found.begin < found.end && !in(found.begin)) ++found.begin;
    while (found.begin < found.end && !in(found.end - 1)) --found.end;
    return found;
  }

  Ball ball_;
  std::int32_t grain_;
  double resolution_, radius2_;
};

}  // namespace

std::vector<Cell> crop(const std::vector<Cell>& cells, double resolution, const Ball& ball) {
  std::vector<Cell> kept;
  std::copy_if(cells.begin(), cells.end(), std::back_inserter(kept), [&](const Cell& cell) {
    return squared_distance(ball.center, to_metres(cell, resolution)) <= ball.radius * ball.radius;
  });
  return kept;
}

std::size_t count_touched(const std::vector<Cell>& cells, double resolution,
                          std::span<const Capsule> capsules) {
  const CapsuleSet all(capsules);
  return static_cast<std::size_t>(std::count_if(cells.begin(), cells.end(), [&](const Cell& cell) {
    return all.touches(to_metres(cell, resolution));
  }));
}

CutOut cut_out(const std::vector<Cell>& cells, double resolution,
               std::span<const Capsule> capsules) {
  constexpr std::size_t more_max = std::size_t{1} << 22U;
  const CapsuleSet all(capsules);
  CutOut cut;
  std::vector<Cell> stack;
  for (const Cell& leaf : cells) {
    const std::size_t before = cut.voxels;
    stack.push_back(leaf);
    while (!stack.empty()) {
      const Cell cell = stack.back();
      stack.pop_back();
      if (!all.touches(to_metres(cell, resolution))) {
        cut.cells.push_back(cell);
      } else if (cell.size > 1) {
        push_children(cell, stack);
      } else {
        ++cut.voxels;
      }
      if (cut.cells.size() + cut.voxels > cells.size() + more_max)
        throw Error(
            ErrorCode::invalid,
            fmt::format(
                "voxels of {} m are too fine to cut shapes out of the map: more than {} pieces",
                resolution, more_max));
    }
    cut.leaves += cut.voxels > before ? 1 : 0;
  }
  return cut;
}

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

double volume_inside(const std::vector<Cell>& cells, double resolution, const Ball& ball) {
  double voxels = 0.0;
  const double radius2 = ball.radius * ball.radius;
  // A voxel counts if the centre of its grain is in the ball. Then volumes add up however space is
  // divided into cells.
  std::int32_t grain = 1;
  while (2.0 * grain * 128.0 * resolution <= ball.radius && grain < (1 << 15)) grain *= 2;
  const GrainsInBall grains(ball, grain, resolution);
  for (const Cell& cell : cells) {
    const double edge = cell.size, volume = edge * edge * edge;
    if (cell.size <= grain) {
      if (grains.contains(cell.lo)) voxels += volume;
      continue;
    }
    const Box box = to_metres(cell, resolution);
    if (squared_distance(ball.center, box) > radius2) continue;
    voxels += squared_distance_to_farthest_corner(ball.center, box) <= radius2
                  ? volume
                  : grains.volume(cell);
  }
  return voxels * resolution * resolution * resolution;
}

std::vector<VoxelBox> merge(const std::vector<Cell>& cells) {
  std::vector<VoxelBox> boxes;
  std::map<std::array<std::int32_t, 3>, std::vector<Cell>> tiles;
  for (const Cell& cell : cells) {
    if (cell.size >= wide) {
      boxes.push_back(
          {cell.lo, {cell.lo[0] + cell.size, cell.lo[1] + cell.size, cell.lo[2] + cell.size}});
      continue;
    }
    std::array<std::int32_t, 3> origin{};
    for (std::size_t axis = 0; axis < 3; ++axis)
      origin[axis] = first_of_tile(cell.lo[axis]);
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

namespace {

// Calls f(x0, x1, y, z) for each row of a part of a tile.
template <class F>
void each_row(const VoxelBox& part, const std::array<std::int32_t, 3>& origin, const F& f) {
  for (std::int32_t z = part.lo[2]; z < part.hi[2]; ++z)
    for (std::int32_t y = part.lo[1]; y < part.hi[1]; ++y)
      f(part.lo[0] - origin[0], part.hi[0] - origin[0], y - origin[1], z - origin[2]);
}

}  // namespace

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

namespace {

// Rectangles in a plane as boxes of one voxel along z.
using Flat = VoxelBox;

// Calls f with the tiles that a rectangle touches.
template <class F>
void each_tile(const Flat& flat, const F& f) {
  for (std::int32_t y = first_of_tile(flat.lo[1]); y < flat.hi[1]; y += tile)
    for (std::int32_t x = first_of_tile(flat.lo[0]); x < flat.hi[0]; x += tile)
      f(std::array<std::int32_t, 3>{x, y, 0});
}

// Disjoint rectangles with what is in some of `of` and in none of `covers`, all of them in one
// plane. Few are cut to pieces; many are drawn.
void uncovered(const std::vector<Flat>& of, const std::vector<Flat>& covers, BitGrid& grid,
               std::vector<Flat>& out) {
  constexpr std::size_t few = 64;
  if (of.size() * covers.size() <= few) {
    for (const Flat& flat : of) {
      std::vector<Flat> pieces{flat};
      for (const Flat& cover : covers) subtract(pieces, cover);
      out.insert(out.end(), pieces.begin(), pieces.end());
    }
    return;
  }
  struct Drawn {
    std::vector<const Flat*> of, covers;
  };
  std::map<std::array<std::int32_t, 3>, Drawn> tiles;
  for (const Flat& flat : of)
    each_tile(flat, [&](const auto& at) { tiles[at].of.push_back(&flat); });
  for (const Flat& cover : covers)
    each_tile(cover, [&](const auto& at) {
      if (const auto found = tiles.find(at); found != tiles.end())
        found->second.covers.push_back(&cover);
    });
  for (const auto& [origin, drawn] : tiles) {
    const VoxelBox window{origin, {origin[0] + tile, origin[1] + tile, 1}};
    VoxelBox used;
    for (const Flat* flat : drawn.of) {
      const VoxelBox part = common(*flat, window);
      each_row(part, origin, [&](auto... row) { grid.set_row(row...); });
      used = hull(used, part);
    }
    for (const Flat* cover : drawn.covers)
      each_row(common(*cover, window), origin, [&](auto... row) { grid.clear_row(row...); });
    for (std::size_t i = 0; i < 2; ++i) {
      used.lo[i] -= origin[i];
      used.hi[i] -= origin[i];
    }
    extract_blocks(grid, used, origin, out);
  }
}

}  // namespace

std::vector<VoxelBox> surface(const std::vector<VoxelBox>& boxes) {
  std::vector<VoxelBox> faces;
  BitGrid grid(1);
  std::vector<Flat> bare;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    // of boxes that end, and that begin, at each plane
    struct Side {
      std::vector<Flat> up, down;
    };
    std::map<std::int32_t, Side> planes;
    for (const VoxelBox& box : boxes) {
      const Flat flat{{box.lo[u], box.lo[v], 0}, {box.hi[u], box.hi[v], 1}};
      planes[box.hi[axis]].up.push_back(flat);
      planes[box.lo[axis]].down.push_back(flat);
    }
    for (const auto& [at, sides] : planes) {
      bare.clear();
      uncovered(sides.up, sides.down, grid, bare);
      uncovered(sides.down, sides.up, grid, bare);
      for (const Flat& flat : bare) {
        VoxelBox face;
        face.lo[axis] = face.hi[axis] = at;
        face.lo[u] = flat.lo[0];
        face.hi[u] = flat.hi[0];
        face.lo[v] = flat.lo[1];
        face.hi[v] = flat.hi[1];
        faces.push_back(face);
      }
    }
  }
  return faces;
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

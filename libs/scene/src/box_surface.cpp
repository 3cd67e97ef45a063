#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "bit_grid.hpp"
#include "hamelin/scene/boxes.hpp"
#include "voxel_boxes.hpp"

namespace hamelin::scene {

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

}  // namespace hamelin::scene

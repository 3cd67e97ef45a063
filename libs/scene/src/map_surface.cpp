#include "map_surface.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "voxel_boxes.hpp"

namespace hamelin::scene {

namespace {

// The smallest edge of a tile [voxels], and the largest number of tiles along an axis.
constexpr std::int32_t edge_min = 32, count_max = 16;

// What a rectangle and a box have in common may have no area.
bool is_rectangle(const VoxelBox& face) {
  int flat = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    if (face.hi[i] < face.lo[i]) return false;
    flat += face.hi[i] == face.lo[i] ? 1 : 0;
  }
  return flat == 1;
}

}  // namespace

void MapSurface::divide(const BoxField& boxes) {
  boxes.for_each_alive(
      [&](const Box& box) { extent_ = hull(extent_, to_voxels(box, resolution_)); });
  edge_ = edge_min;
  for (std::size_t i = 0; i < 3; ++i)
    edge_ = std::max(edge_, (extent_.hi[i] - extent_.lo[i] + count_max - 1) / count_max);
  std::size_t all = 1;
  for (std::size_t i = 0; i < 3; ++i) {
    count_[i] = (extent_.hi[i] - extent_.lo[i] + edge_ - 1) / edge_;
    all *= static_cast<std::size_t>(count_[i]);
  }
  tiles_ = std::make_unique<Tile[]>(all);
}

VoxelBox MapSurface::extent_of(const Index& tile) const {
  VoxelBox out;
  for (std::size_t i = 0; i < 3; ++i) {
    out.lo[i] = extent_.lo[i] + edge_ * tile[i];
    out.hi[i] = out.lo[i] + edge_;
  }
  return out;
}

// The voxels next to a tile decide whether what ends at its border is surface.
const BoxField& MapSurface::faces(const BoxField& boxes, const Index& at) {
  Tile& tile = tiles_[static_cast<std::size_t>((at[2] * count_[1] + at[1]) * count_[0] + at[0])];
  std::call_once(tile.made, [&] {
    const VoxelBox extent = extent_of(at);
    VoxelBox wide = extent;
    for (std::size_t i = 0; i < 3; ++i) {
      --wide.lo[i];
      ++wide.hi[i];
    }
    std::vector<std::int32_t> near;
    boxes.overlapping(to_metres(wide, resolution_), near);
    std::vector<VoxelBox> parts;
    parts.reserve(near.size());
    for (const std::int32_t box : near)
      parts.push_back(
          common(to_voxels(boxes.boxes()[static_cast<std::size_t>(box)], resolution_), wide));
    std::vector<Box> found;
    for (const VoxelBox& face : surface(parts))
      if (const VoxelBox part = common(face, extent); is_rectangle(part))
        found.push_back(to_metres(part, resolution_));
    const Box around = to_metres(extent, resolution_);
    tile.faces = BoxField(std::move(found), 0.5 * (around.lo + around.hi));
  });
  return tile.faces;
}

// Tiles around that of p, ring by ring, until the next ring is farther than what was found.
MapSurface::Nearest MapSurface::nearest(const BoxField& boxes, const Eigen::Vector3d& p) {
  std::call_once(divided_, [&] { divide(boxes); });
  Nearest best;
  const double edge_m = edge_ * resolution_;
  Index at{};
  for (std::size_t i = 0; i < 3; ++i) {
    const double way = p[static_cast<Eigen::Index>(i)] - extent_.lo[i] * resolution_;
    at[i] = static_cast<std::int32_t>(
        std::clamp(std::floor(way / edge_m), 0.0, static_cast<double>(count_[i] - 1)));
  }
  const auto visit = [&](const Index& tile) {
    const BoxField& of = faces(boxes, tile);
    BoxHit hit;
    if (!of.nearest(p, best.distance, hit)) return;
    const double distance = std::abs(hit.distance);
    if (distance >= best.distance) return;
    best = {distance, hit.point, hit.direction, of.boxes()[static_cast<std::size_t>(hit.box)]};
  };
  for (std::int32_t ring = 0;; ++ring) {
    double beyond = infinity;  // how far what the ring adds is at least
    Index lo{}, hi{};
    for (std::size_t i = 0; i < 3; ++i) {
      const double x = p[static_cast<Eigen::Index>(i)], zero = extent_.lo[i] * resolution_;
      lo[i] = std::max(at[i] - ring, 0);
      hi[i] = std::min(at[i] + ring, count_[i] - 1);
      if (at[i] - ring >= 0) beyond = std::min(beyond, x - (zero + (at[i] - ring + 1) * edge_m));
      if (at[i] + ring < count_[i]) beyond = std::min(beyond, zero + (at[i] + ring) * edge_m - x);
    }
    if (ring > 0 && beyond >= best.distance) return best;
    for (Index tile{lo[0], lo[1], lo[2]}; tile[2] <= hi[2]; ++tile[2])
      for (tile[1] = lo[1]; tile[1] <= hi[1]; ++tile[1])
        for (tile[0] = lo[0]; tile[0] <= hi[0]; ++tile[0]) {
          const auto apart = [&](std::size_t i) { return std::abs(tile[i] - at[i]); };
          if (std::max({apart(0), apart(1), apart(2)}) == ring) visit(tile);
        }
  }
}

void MapSurface::prepare(const BoxField& boxes) {
  std::call_once(divided_, [&] { divide(boxes); });
  Index tile{};
  for (tile[2] = 0; tile[2] < count_[2]; ++tile[2])
    for (tile[1] = 0; tile[1] < count_[1]; ++tile[1])
      for (tile[0] = 0; tile[0] < count_[0]; ++tile[0]) (void)faces(boxes, tile);
}

}  // namespace hamelin::scene

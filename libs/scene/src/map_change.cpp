#include "hamelin/scene/map_change.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "hamelin/core/error.hpp"
#include "hamelin/scene/map_region.hpp"

namespace hamelin::scene {

namespace {

// The voxels that share volume with the boxes, within the cube around the ball.
std::vector<VoxelBox> touched(const std::vector<Box>& boxes, double resolution, const Ball& ball) {
  // In voxels: a face at 0.3 m is the face of a voxel of 0.1 m in spite of rounding.
  constexpr double tolerance = 1e-9;
  std::vector<VoxelBox> voxels;
  for (const Box& box : boxes) {
    VoxelBox out;
    bool any = true;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<Eigen::Index>(axis);
      const double lo = std::max(box.lo[a], ball.center[a] - ball.radius - resolution) / resolution,
                   hi = std::min(box.hi[a], ball.center[a] + ball.radius + resolution) / resolution;
      any = any && hi > lo;
      if (!any) break;
      out.lo[axis] = static_cast<std::int32_t>(std::floor(lo + tolerance));
      out.hi[axis] = static_cast<std::int32_t>(std::ceil(hi - tolerance));
      any = out.hi[axis] > out.lo[axis];
    }
    if (any) voxels.push_back(out);
  }
  return voxels;
}

}  // namespace

MapChange read_change(const MapChangeSpec& change, const MapSpec& map, double resolution_m,
                      const Ball& ball) {
  MapChange out;
  out.time_s = change.time_s;
  if (change.file) {
    ReadMapOptions options{map.scale, map.occupancy_threshold};
    options.keep_free = true;
    const MapData data = read_map(*change.file, options);
    if (std::abs(data.resolution - resolution_m) > 1e-9 * resolution_m)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: resolution {} m, expected {} m as in the map that it changes",
                              change.file->string(), data.resolution, resolution_m));
    out.free = merge(crop(data.free, data.resolution, ball));
    out.occupied = merge(crop(data.occupied, data.resolution, ball));
  }
  const auto append = [&](const std::vector<Box>& boxes, std::vector<VoxelBox>& to) {
    for (const VoxelBox& box : touched(boxes, resolution_m, ball)) {
      std::vector<VoxelBox> pieces{box};
      for (const VoxelBox& present : to) subtract(pieces, present);
      to.insert(to.end(), pieces.begin(), pieces.end());
    }
  };
  append(change.free_m, out.free);
  append(change.occupied_m, out.occupied);
  return out;
}

}  // namespace hamelin::scene

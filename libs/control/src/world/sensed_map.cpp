#include "world/sensed_map.hpp"

#include <bit>
#include <cmath>

#include "hamelin/sensing/map_grid.hpp"

namespace hamelin::control {

using sensing::OccupancyGrid;
using State = OccupancyGrid::State;

SensedMap::SensedMap(const scene::Environment& environment, const sensing::SensorModel& model)
    : ball_(environment.map_ball()),
      unknown_matters_(environment.summary().unknown != scene::UnknownPolicy::free),
      grid_(sensing::grid_of(environment, model)) {}

bool SensedMap::occupied(const Eigen::Vector3d& p) const {
  OccupancyGrid::Voxel voxel;
  for (std::size_t i = 0; i < 3; ++i)
    voxel[i] = static_cast<std::int32_t>(
        std::floor(p[static_cast<Eigen::Index>(i)] / grid_.resolution_m()));
  return grid_.state(voxel) == State::occupied;
}

scene::MapChange SensedMap::insert(const Eigen::Ref<const Eigen::Matrix3Xf>& points,
                                   const Eigen::Vector3d& origin, double range_m) {
  scene::MapChange change;
  for (const OccupancyGrid::Row& row : grid_.insert(points, origin.cast<float>(), range_m)) {
    add_runs(row, row.occupied, change.occupied);
    // what was unknown and is free now was no obstacle before, where unknown space is free
    add_runs(row, unknown_matters_ ? row.freed : row.freed & ~row.learned, change.free);
  }
  return change;
}

void SensedMap::add_runs(const OccupancyGrid::Row& row, std::uint64_t bits,
                         std::vector<scene::VoxelBox>& out) const {
  while (bits != 0) {
    const int first = std::countr_zero(bits), count = std::countr_one(bits >> first);
    bits &= first + count < 64 ? ~std::uint64_t{0} << (first + count) : 0;
    const std::int32_t x = row.first[0] + first;
    const scene::VoxelBox run{{x, row.first[1], row.first[2]},
                              {x + count, row.first[1] + 1, row.first[2] + 1}};
    const scene::Box box = scene::to_metres(run, grid_.resolution_m());
    if ((ball_.center.cwiseMax(box.lo).cwiseMin(box.hi) - ball_.center).norm() <= ball_.radius)
      out.push_back(run);
  }
}

}  // namespace hamelin::control

#include "world/sensed_map.hpp"

#include <bit>
#include <cmath>

#include "hamelin/sensing/map_grid.hpp"

namespace hamelin::control {

using sensing::OccupancyGrid;
using State = OccupancyGrid::State;

namespace {

// What has been there for so long stands still [s].
constexpr double fresh_s = 1.0;
// Points that are this near to what stands still may be part of it [m].
constexpr double next_to_m = 0.02;

std::uint64_t key_of(const OccupancyGrid::Voxel& voxel) {
  const auto part = [&](std::size_t i) {
    return static_cast<std::uint64_t>(static_cast<std::uint16_t>(voxel[i]));
  };
  return part(0) | part(1) << 16U | part(2) << 32U;
}

}  // namespace

SensedMap::SensedMap(const scene::Environment& environment, const sensing::SensorModel& model)
    : ball_(environment.map_ball()),
      unknown_matters_(environment.summary().unknown != scene::UnknownPolicy::free),
      grid_(sensing::grid_of(environment, model)) {}

SensedMap::Voxel SensedMap::voxel_of(const Eigen::Vector3d& p) const {
  Voxel voxel;
  for (std::size_t i = 0; i < 3; ++i)
    voxel[i] = static_cast<std::int32_t>(
        std::floor(p[static_cast<Eigen::Index>(i)] / grid_.resolution_m()));
  return voxel;
}

bool SensedMap::occupied(const Eigen::Vector3d& p) const {
  return grid_.state(voxel_of(p)) == State::occupied;
}

bool SensedMap::stands(const Voxel& voxel, double time_s) const {
  if (grid_.state(voxel) != State::occupied) return false;
  const auto fresh = fresh_.find(key_of(voxel));
  return fresh == fresh_.end() || time_s - fresh->second > fresh_s;
}

std::vector<std::uint8_t> SensedMap::loose(const Eigen::Ref<const Eigen::Matrix3Xf>& points,
                                           double time_s) const {
  std::vector<std::uint8_t> out(static_cast<std::size_t>(points.cols()), 0);
  const auto near = static_cast<std::int32_t>(std::ceil(next_to_m / grid_.resolution_m()));
  const auto is_next_to_what_stands = [&](const Voxel& at) {
    for (std::int32_t z = -near; z <= near; ++z)
      for (std::int32_t y = -near; y <= near; ++y)
        for (std::int32_t x = -near; x <= near; ++x)
          if (stands({at[0] + x, at[1] + y, at[2] + z}, time_s)) return true;
    return false;
  };
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Voxel at = voxel_of(points.col(i).cast<double>());
    if (grid_.state(at) == State::unknown || stands(at, time_s)) continue;
    out[static_cast<std::size_t>(i)] = is_next_to_what_stands(at) ? 0 : 1;
  }
  return out;
}

void SensedMap::note_fresh(const OccupancyGrid::Row& row, double time_s) {
  for (std::uint64_t left = row.occupied & ~row.learned; left != 0; left &= left - 1)
    fresh_[key_of({row.first[0] + std::countr_zero(left), row.first[1], row.first[2]})] = time_s;
}

scene::MapChange SensedMap::insert(const Eigen::Ref<const Eigen::Matrix3Xf>& points,
                                   const Eigen::Vector3d& origin, double range_m, double time_s) {
  scene::MapChange change;
  std::erase_if(fresh_, [&](const auto& entry) { return time_s - entry.second > fresh_s; });
  for (const OccupancyGrid::Row& row : grid_.insert(points, origin.cast<float>(), range_m)) {
    note_fresh(row, time_s);
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

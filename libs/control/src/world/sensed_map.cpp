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

// Calls f with each run of set bits of a row.
template <class F>
void each_run(const OccupancyGrid::Row& row, std::uint64_t bits, const F& f) {
  while (bits != 0) {
    const int first = std::countr_zero(bits), count = std::countr_one(bits >> first);
    bits &= first + count < 64 ? ~std::uint64_t{0} << (first + count) : 0;
    const std::int32_t x = row.first[0] + first;
    f(scene::VoxelBox{{x, row.first[1], row.first[2]},
                      {x + count, row.first[1] + 1, row.first[2] + 1}});
  }
}

sensing::SensorModel model_of(const scene::PointsSpec& points) {
  return {points.hit, points.miss, points.least, points.most, 0.5};
}

scene::VoxelBox around(const OccupancyGrid::Voxel& voxel, std::int32_t reach) {
  scene::VoxelBox out{voxel, voxel};
  for (std::size_t i = 0; i < 3; ++i) {
    out.lo[i] -= reach;
    out.hi[i] += reach + 1;
  }
  return out;
}

}  // namespace

SensedMap::SensedMap(const scene::Environment& environment)
    : ball_(environment.map_ball()),
      unknown_matters_(environment.summary().unknown != scene::UnknownPolicy::free),
      close_gaps_(unknown_matters_ && environment.map_spec()->points.close_gaps),
      grid_(sensing::grid_of(environment, model_of(environment.map_spec()->points))),
      standing_(grid_.box()) {
  environment.map_field().boxes().for_each_alive(
      [&](const scene::Box& box) { standing_.set(scene::to_voxels(box, grid_.resolution_m())); });
}

bool SensedMap::occupied(const Eigen::Vector3d& p) const {
  return grid_.state(grid_.voxel_of(p)) == State::occupied;
}

std::vector<std::uint8_t> SensedMap::loose(const Eigen::Ref<const Eigen::Matrix3Xf>& points,
                                           double time_s) {
  age(time_s);
  std::vector<std::uint8_t> out(static_cast<std::size_t>(points.cols()), 0);
  const auto near = static_cast<std::int32_t>(std::ceil(next_to_m / grid_.resolution_m()));
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Voxel at = grid_.voxel_of(points.col(i).cast<double>());
    if (standing_.any(around(at, near)) || grid_.state(at) == State::unknown) continue;
    out[static_cast<std::size_t>(i)] = 1;
  }
  return out;
}

void SensedMap::age(double time_s) {
  for (; !fresh_.empty() && time_s - fresh_.front().first > fresh_s; fresh_.pop_front()) {
    const scene::VoxelBox& run = fresh_.front().second;
    for (std::int32_t x = run.lo[0]; x < run.hi[0]; ++x) {
      const Voxel voxel{x, run.lo[1], run.lo[2]};
      if (grid_.state(voxel) == State::occupied) standing_.set(around(voxel, 0));
    }
  }
}

void SensedMap::note_change(const OccupancyGrid::Row& row, double time_s) {
  each_run(row, row.occupied & row.learned,
           [&](const scene::VoxelBox& run) { standing_.set(run); });
  each_run(row, row.occupied & ~row.learned,
           [&](const scene::VoxelBox& run) { fresh_.emplace_back(time_s, run); });
  each_run(row, row.freed & ~row.learned,
           [&](const scene::VoxelBox& run) { standing_.clear(run); });
}

scene::MapChange SensedMap::insert(const Eigen::Ref<const Eigen::Matrix3Xf>& points,
                                   const Eigen::Vector3d& origin, double range_m, double time_s) {
  scene::MapChange change;
  age(time_s);
  for (const OccupancyGrid::Row& row : grid_.insert(points, origin.cast<float>(), range_m)) {
    note_change(row, time_s);
    add_runs(row, row.occupied, change.occupied);
    // what was unknown and is free now was no obstacle before, where unknown space is free
    add_runs(row, unknown_matters_ ? row.freed : row.freed & ~row.learned, change.free);
  }
  if (close_gaps_)
    for (const OccupancyGrid::Row& row : grid_.gaps()) add_runs(row, row.freed, change.free);
  return change;
}

void SensedMap::add_runs(const OccupancyGrid::Row& row, std::uint64_t bits,
                         std::vector<scene::VoxelBox>& out) const {
  each_run(row, bits, [&](const scene::VoxelBox& run) {
    const scene::Box box = scene::to_metres(run, grid_.resolution_m());
    if ((ball_.center.cwiseMax(box.lo).cwiseMin(box.hi) - ball_.center).norm() <= ball_.radius)
      out.push_back(run);
  });
}

}  // namespace hamelin::control

#include "hamelin/sensing/map_grid.hpp"

#include <algorithm>
#include <cmath>

#include "ray.hpp"

namespace hamelin::sensing {

namespace {

scene::VoxelBox box_around(const scene::Ball& ball, double resolution) {
  scene::VoxelBox box;
  for (std::size_t i = 0; i < 3; ++i) {
    const double center = ball.center[static_cast<Eigen::Index>(i)];
    const auto voxel = [&](double x) {
      constexpr double limit = key_limit;
      return static_cast<std::int32_t>(std::clamp(std::floor(x / resolution), -limit, limit));
    };
    box.lo[i] = voxel(center - ball.radius);
    box.hi[i] = voxel(center + ball.radius + resolution);
  }
  return box;
}

void set_all(OccupancyGrid& grid, const scene::BoxField& boxes, OccupancyGrid::State state) {
  boxes.for_each_alive(
      [&](const scene::Box& box) { grid.set(scene::to_voxels(box, grid.resolution_m()), state); });
}

}  // namespace

OccupancyGrid grid_of(const scene::Environment& environment, const SensorModel& model) {
  const double resolution = environment.summary().resolution_m;
  OccupancyGrid grid(resolution, box_around(environment.map_ball(), resolution), model);
  if (environment.summary().unknown != scene::UnknownPolicy::free) {
    grid.set(grid.box(), OccupancyGrid::State::free);
    set_all(grid, environment.unknown_field().boxes(), OccupancyGrid::State::unknown);
  }
  set_all(grid, environment.map_field().boxes(), OccupancyGrid::State::occupied);
  return grid;
}

}  // namespace hamelin::sensing

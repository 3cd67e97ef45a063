#pragma once
#include <Eigen/Core>

#include "hamelin/scene/environment.hpp"
#include "hamelin/sensing/occupancy_grid.hpp"

namespace hamelin::control {

/// What is known of the voxels of an environment's map, which frames of points change.
class SensedMap {
 public:
  /// All that the map knows counts as seen before.
  SensedMap(const scene::Environment& environment, const sensing::SensorModel& model);

  /// Whether a point of the map's frame is in an occupied voxel.
  [[nodiscard]] bool occupied(const Eigen::Vector3d& p) const;

  /// Takes a frame, see OccupancyGrid::insert(). @return what changes in the map
  [[nodiscard]] scene::MapChange insert(const Eigen::Ref<const Eigen::Matrix3Xf>& points,
                                        const Eigen::Vector3d& origin, double range_m);

 private:
  void add_runs(const sensing::OccupancyGrid::Row& row, std::uint64_t bits,
                std::vector<scene::VoxelBox>& out) const;

  scene::Ball ball_;  ///< beyond which the map does not matter
  bool unknown_matters_;
  sensing::OccupancyGrid grid_;
};

}  // namespace hamelin::control

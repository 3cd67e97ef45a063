#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <utility>
#include <vector>

#include "hamelin/scene/distance_field.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/sensing/occupancy_grid.hpp"

namespace hamelin::control {

/// What is known of the voxels of an environment's map, which frames of points change.
class SensedMap {
 public:
  /// All that the map, which there must be, knows counts as seen before.
  explicit SensedMap(const scene::Environment& environment);

  /// Whether a point of the map's frame is in an occupied voxel.
  [[nodiscard]] bool occupied(const Eigen::Vector3d& p) const;

  /// Per point of the map's frame: whether it is where nothing stood for long, and what does is not
  /// next to it.
  [[nodiscard]] std::vector<std::uint8_t> loose(const Eigen::Ref<const Eigen::Matrix3Xf>& points,
                                                double time_s);

  /// Takes a frame, see OccupancyGrid::insert(). @return what changes in the map
  [[nodiscard]] scene::MapChange insert(const Eigen::Ref<const Eigen::Matrix3Xf>& points,
                                        const Eigen::Vector3d& origin, double range_m,
                                        double time_s);

 private:
  using Voxel = sensing::OccupancyGrid::Voxel;
  void note_change(const sensing::OccupancyGrid::Row& row, double time_s);
  /// What became occupied long before stands now, if it is occupied.
  void age(double time_s);
  void add_runs(const sensing::OccupancyGrid::Row& row, std::uint64_t bits,
                std::vector<scene::VoxelBox>& out) const;

  scene::Ball ball_;  ///< beyond which the map does not matter
  bool unknown_matters_, close_gaps_;
  sensing::OccupancyGrid grid_;
  scene::VoxelGrid standing_;  ///< occupied, and so for long
  /// Runs of voxels that were free and became occupied, and when.
  std::deque<std::pair<double, scene::VoxelBox>> fresh_;
};

}  // namespace hamelin::control

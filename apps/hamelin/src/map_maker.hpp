#pragma once
#include <Eigen/Core>
#include <limits>
#include <memory>
#include <string>

#include "hamelin/scene/map_file.hpp"

namespace hamelin::app {

/// Makes an OctoMap of frames of points by the library itself, of any extent: what an OccupancyGrid
/// knows of the same frames, as a file.
class MapMaker {
 public:
  /// @param resolution_m edge of a voxel @throws Error invalid if it is not positive
  explicit MapMaker(double resolution_m);
  ~MapMaker();
  MapMaker(MapMaker&&) noexcept;
  MapMaker& operator=(MapMaker&&) noexcept;

  /// @param points, origin, range_m as OccupancyGrid::insert() has them
  /// @throws Error invalid for an origin or points that are not finite or outside of OctoMap's 2¹⁶
  ///         voxels
  void insert(const Eigen::Ref<const Eigen::Matrix3Xf>& points, const Eigen::Vector3f& origin,
              double range_m = std::numeric_limits<double>::infinity());
  [[nodiscard]] std::size_t occupied() const;  ///< voxels
  [[nodiscard]] std::size_t free() const;      ///< voxels
  /// The bytes of a file; `.bt` has occupied and free only.
  [[nodiscard]] std::string bytes(scene::MapFormat format);

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace hamelin::app

#pragma once
#include <Eigen/Core>
#include <array>
#include <memory>
#include <mutex>

#include "hamelin/core/numbers.hpp"
#include "hamelin/scene/distance.hpp"

namespace hamelin::scene {

/// The surface of a union of boxes, which are given with each call. It is kept in tiles, each
/// computed when a query first comes near, so that a map that changes often costs what is asked of
/// it. Calls may run on several threads.
class MapSurface {
 public:
  explicit MapSurface(double resolution_m) : resolution_(resolution_m) {}

  struct Nearest {
    double distance = infinity;  ///< [m]
    Eigen::Vector3d point = Eigen::Vector3d::Zero(), direction = Eigen::Vector3d::Zero();
    Box face;  ///< the rectangle that the point is on
  };
  /// The nearest of the rectangles F of docs/theory.md (11.5). Allocates where a tile is needed for
  /// the first time.
  [[nodiscard]] Nearest nearest(const BoxField& boxes, const Eigen::Vector3d& p);
  /// Computes all tiles now.
  void prepare(const BoxField& boxes);

 private:
  struct Tile {
    std::once_flag made;
    BoxField faces;
  };
  using Index = std::array<std::int32_t, 3>;
  void divide(const BoxField& boxes);
  [[nodiscard]] const BoxField& faces(const BoxField& boxes, const Index& at);
  [[nodiscard]] VoxelBox extent_of(const Index& tile) const;

  double resolution_;
  std::once_flag divided_;
  VoxelBox extent_;
  std::int32_t edge_ = 1;  ///< of a tile [voxels]
  Index count_{};
  std::unique_ptr<Tile[]> tiles_;
};

}  // namespace hamelin::scene

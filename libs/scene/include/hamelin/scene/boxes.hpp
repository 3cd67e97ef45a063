#pragma once
#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "hamelin/scene/map_file.hpp"

namespace hamelin::scene {

/// Axis-parallel box [lo, hi], in metres.
struct Box {
  Eigen::Vector3d lo = Eigen::Vector3d::Zero(), hi = Eigen::Vector3d::Zero();
};

/// Axis-parallel box [lo, hi), in voxels.
struct VoxelBox {
  std::array<std::int32_t, 3> lo{}, hi{};
};

/// Ball in the map's frame [m].
struct Ball {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius = 0.0;
};

/// The cells that touch the ball, whole and in the order given.
[[nodiscard]] std::vector<Cell> crop(const std::vector<Cell>& cells, double resolution, const Ball& ball);

/// All points within `radius` of the segment between two points, which may be one, in the map's frame [m].
struct Rod {
  Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = Eigen::Vector3d::Zero();
  double radius = 0.0;
};

/// How many cells any rod touches.
[[nodiscard]] std::size_t count_touched(const std::vector<Cell>& cells, double resolution, std::span<const Rod> rods);

/// What cut_out() leaves and what it took.
struct CutOut {
  std::vector<Cell> cells;
  std::size_t voxels = 0;  ///< taken
  std::size_t leaves = 0;  ///< cells that lost any
};

/// The cells without the voxels that any rod touches; cells are split as far as needed.
/// @throws Error invalid if that makes more than 2²² more of them: the voxels are far too fine for such rods
[[nodiscard]] CutOut cut_out(const std::vector<Cell>& cells, double resolution, std::span<const Rod> rods);

/// Volume of the cells inside the ball [m³], exact to the voxels at its surface, or to cells of 1/128 of its radius
/// where voxels are finer than that.
[[nodiscard]] double volume_inside(const std::vector<Cell>& cells, double resolution, const Ball& ball);

/// Disjoint boxes with exactly the union of the (disjoint) cells. Small cells are painted into bit grids of 256³ voxels
/// and taken out as greedy blocks; wide ones go as they are; then boxes with a common face are joined. Deterministic.
[[nodiscard]] std::vector<VoxelBox> merge(const std::vector<Cell>& cells);

/// Joins boxes that share whole faces until none do; disjoint boxes stay disjoint.
void join(std::vector<VoxelBox>& boxes);

[[nodiscard]] inline bool overlap(const VoxelBox& a, const VoxelBox& b) noexcept {
  return a.lo[0] < b.hi[0] && b.lo[0] < a.hi[0] && a.lo[1] < b.hi[1] && b.lo[1] < a.hi[1] && a.lo[2] < b.hi[2] &&
         b.lo[2] < a.hi[2];
}

/// What is left of `boxes` without `hole`: each is cut into at most six.
void subtract(std::vector<VoxelBox>& boxes, const VoxelBox& hole);

/// The surface of the union of disjoint boxes, as rectangles: boxes without extent along one axis. Where two boxes
/// touch there is no surface.
[[nodiscard]] std::vector<VoxelBox> surface(const std::vector<VoxelBox>& boxes);

/// Voxels to metres.
[[nodiscard]] Box to_metres(const VoxelBox& box, double resolution);
[[nodiscard]] Box to_metres(const Cell& cell, double resolution);

/// And back; for boxes that came from voxels of this resolution.
[[nodiscard]] VoxelBox to_voxels(const Box& box, double resolution);

}  // namespace hamelin::scene

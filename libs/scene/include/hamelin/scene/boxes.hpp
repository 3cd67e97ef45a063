#pragma once
#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "hamelin/scene/map_file.hpp"

namespace hamelin::scene {

/// Axis-aligned box [lo, hi] [m].
struct Box {
  Eigen::Vector3d lo = Eigen::Vector3d::Zero(), hi = Eigen::Vector3d::Zero();
  [[nodiscard]] bool operator==(const Box&) const = default;
};

/// Axis-aligned box [lo, hi), in voxels.
struct VoxelBox {
  std::array<std::int32_t, 3> lo{}, hi{};
};

/// Ball in the map's frame [m].
struct Ball {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius = 0.0;
};

/// The cells that touch the ball. Cells are kept whole and in their order.
[[nodiscard]] std::vector<Cell> crop(const std::vector<Cell>& cells, double resolution,
                                     const Ball& ball);

/// All points within `radius` of a segment, in the map's frame [m]; a ball if both ends are equal.
struct Capsule {
  Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = Eigen::Vector3d::Zero();
  double radius = 0.0;
};

/// How many cells touch any of the capsules.
[[nodiscard]] std::size_t count_touched(const std::vector<Cell>& cells, double resolution,
                                        std::span<const Capsule> capsules);

/// The result of cut_out().
struct CutOut {
  std::vector<Cell> cells;  ///< what remains
  std::size_t voxels = 0;   ///< how many were removed
  std::size_t leaves = 0;   ///< how many cells lost any voxel
};

/// How many voxels disjoint boxes have.
[[nodiscard]] std::size_t voxels_in(const std::vector<VoxelBox>& boxes);

/// Removes the voxels that touch any of the capsules. Cells are split as far as needed.
/// @throws Error invalid if that makes more than 2²² additional cells: the voxels are far too fine
///        for such capsules
[[nodiscard]] CutOut cut_out(const std::vector<Cell>& cells, double resolution,
                             std::span<const Capsule> capsules);

/// Volume of the cells inside the ball [m³]. Whole voxels count, by their centres; where voxels are
/// finer than 1/128 of the radius, cells of up to that size. See docs/theory.md (11.38).
[[nodiscard]] double volume_inside(const std::vector<Cell>& cells, double resolution,
                                   const Ball& ball);

/// Disjoint boxes with exactly the union of the disjoint cells. Small cells are drawn into bit
/// grids of 256³ voxels, from which blocks are extracted greedily. Wide cells are boxes already.
/// Then boxes with a common face are joined. Deterministic.
[[nodiscard]] std::vector<VoxelBox> merge(const std::vector<Cell>& cells);

/// Joins boxes that share whole faces until none do; disjoint boxes stay disjoint.
void join(std::vector<VoxelBox>& boxes);

[[nodiscard]] inline bool overlap(const VoxelBox& a, const VoxelBox& b) noexcept {
  return a.lo[0] < b.hi[0] && b.lo[0] < a.hi[0] && a.lo[1] < b.hi[1] && b.lo[1] < a.hi[1] &&
         a.lo[2] < b.hi[2] && b.lo[2] < a.hi[2];
}

/// Removes `hole` from the boxes; each box that overlaps it is replaced by at most six pieces.
void subtract(std::vector<VoxelBox>& boxes, const VoxelBox& hole);

/// Disjoint boxes with what remains of a box without holes, which may overlap each other and its
/// faces. Many holes are drawn into bit grids, so time grows with their number and with the volume
/// about them.
[[nodiscard]] std::vector<VoxelBox> without(const VoxelBox& box, std::span<const VoxelBox> holes);

/// The surface of the union of disjoint boxes, as rectangles: boxes without extent along one axis.
/// Where two boxes touch there is no surface. These are the rectangles F of docs/theory.md (11.5).
[[nodiscard]] std::vector<VoxelBox> surface(const std::vector<VoxelBox>& boxes);

/// Voxels to metres.
[[nodiscard]] Box to_metres(const VoxelBox& box, double resolution);
[[nodiscard]] Box to_metres(const Cell& cell, double resolution);

/// Metres to voxels, for boxes that were made from voxels of this resolution.
[[nodiscard]] VoxelBox to_voxels(const Box& box, double resolution);

}  // namespace hamelin::scene

#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
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

/// The cells without the voxels that the ball touches; cells are split as far as needed.
[[nodiscard]] std::vector<Cell> cut_out(const std::vector<Cell>& cells, double resolution, const Ball& ball);

/// Volume of the cells inside the ball [m³], exact to the voxels at its surface.
[[nodiscard]] double volume_inside(const std::vector<Cell>& cells, double resolution, const Ball& ball);

/// Disjoint boxes with exactly the union of the (disjoint) cells. Small cells are painted into bit grids of 256³ voxels
/// and taken out as greedy blocks; wide ones go as they are; then boxes with a common face are joined. Deterministic.
[[nodiscard]] std::vector<VoxelBox> merge(const std::vector<Cell>& cells);

/// Voxels to metres.
[[nodiscard]] Box to_metres(const VoxelBox& box, double resolution);
[[nodiscard]] Box to_metres(const Cell& cell, double resolution);

}  // namespace hamelin::scene

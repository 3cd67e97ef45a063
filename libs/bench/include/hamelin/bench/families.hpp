#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/scene/boxes.hpp"
#include "hamelin/scene/obstacles.hpp"

/// A benchmark of planners: families of clutter, sets of problems, and tables of results.
namespace hamelin::bench {

/// A space that the tip is in at the start or at the goal.
struct Room {
  geometry::SE3 frame;  ///< in the base frame of the arm
  scene::Box box;       ///< in the room's frame [m]
  [[nodiscard]] bool contains(const Eigen::Vector3d& p) const;
};

/// The clutter of one problem around an arm with its base at the origin, x to the front, z up.
struct Layout {
  std::vector<scene::Obstacle> obstacles;  ///< boxes, cylinders and spheres at rest
  Room start, goal;
};

/// The names of the ten families, in the order of tables.
[[nodiscard]] const std::vector<std::string>& families();
/// One line on what a family is.
[[nodiscard]] std::string_view describe(std::string_view family);

/// Draws the dimensions of a family. The same seed gives the same numbers on every machine:
/// positions are multiples of 0.1 mm, and sizes are odd multiples of it, so that no face that is
/// parallel to the axes lies between two voxels.
/// @throws Error usage for an unknown family
[[nodiscard]] Layout make_layout(std::string_view family, std::uint64_t seed);

}  // namespace hamelin::bench

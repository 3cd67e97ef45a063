#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "hamelin/fit/mesh.hpp"
#include "hamelin/fit/shape.hpp"
#include "hamelin/fit/solid.hpp"

namespace hamelin::fit {

/// How far a surface sticks out of a union of shapes: max over its points of the least distance to a shape.
struct Gap {
  double bound_m = 0.0;  ///< proven: no point sticks out farther; 0: each piece of the surface lies within one shape
  double found_m = 0.0;  ///< a point that sticks out this far is there (0: none)
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< that point
};

/// Bounds the gap by cutting triangles: the distance from a shape is convex, so over a piece it is largest at a corner.
/// A piece is cut on while it could raise the gap by more than `tolerance_m`.
[[nodiscard]] Gap coverage_gap(const Mesh& mesh, std::span<const Shape> shapes, double tolerance_m);

/// Raises radii until each piece of the surface (none cut finer than `piece_m`) lies within one shape: the gap is then
/// 0.
/// @param fixed shapes that take part and stay as they are
/// @return the middles of the pieces that stood out of all shapes as given by more than `piece_m`
std::vector<Eigen::Vector3d> seal(const Mesh& mesh, std::span<const Shape> fixed, std::span<Shape> shapes,
                                  double piece_m);

/// How far the union of shapes sticks out of a solid, seen over points spread evenly on the union's surface.
struct Excess {
  double max_m = 0.0, mean_m = 0.0;  ///< distance of such points from the solid; inside it counts as 0
  double area_m2 = 0.0;              ///< of the union's surface
  double volume_m3 = 0.0;            ///< of the union
};

/// @param solid null: nothing to stick out of but `balls`
/// @param balls parts of the solid that are balls
[[nodiscard]] Excess excess(const Solid* solid, std::span<const Shape> balls, std::span<const Shape> shapes);

/// Points evenly on a shape's surface, and the area that each stands for [m²] (Fibonacci lattice).
struct SurfacePoints {
  std::vector<Eigen::Vector3d> points;
  double area_each_m2 = 0.0;
};
[[nodiscard]] SurfacePoints surface_points(const Shape& shape, std::size_t count);

}  // namespace hamelin::fit

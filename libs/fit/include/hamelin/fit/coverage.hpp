#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "hamelin/fit/mesh.hpp"
#include "hamelin/fit/shape.hpp"
#include "hamelin/fit/solid.hpp"

namespace hamelin::fit {

/// How far a surface sticks out of a union of shapes: the largest distance of a surface point from
/// the nearest shape.
struct Gap {
  /// Proven: no point sticks out farther. 0: each piece of the surface lies within one shape.
  double bound_m = 0.0;
  double found_m = 0.0;                             ///< how far `point` sticks out; 0: none found
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< the point found
};

/// Bounds the gap by cutting triangles, docs/theory.md (13.34), (13.35). A piece is cut further
/// while it could raise the gap by more than `tolerance_m`.
[[nodiscard]] Gap coverage_gap(const Mesh& mesh, std::span<const Shape> shapes, double tolerance_m);

/// Raises radii until each piece of the surface (none cut finer than `piece_m`) lies within one
/// shape, so that the gap is 0: the proof of docs/theory.md (13.34).
/// @param fixed shapes that count but keep their radii
/// @return the centroids of the pieces that stuck out of all given shapes by more than `piece_m`
std::vector<Eigen::Vector3d> close_gaps(const Mesh& mesh, std::span<const Shape> fixed,
                                        std::span<Shape> shapes, double piece_m);

/// How far the union of shapes sticks out of a solid, measured at points spread evenly on the
/// surface of the union.
struct Excess {
  double max_m = 0.0, mean_m = 0.0;  ///< distance of the points from the solid; 0 for those inside
  double area_m2 = 0.0;              ///< of the union's surface
  double volume_m3 = 0.0;            ///< of the union
};

/// docs/theory.md (13.37)–(13.39).
/// @param solid null: the solid consists of `balls` only
/// @param balls parts of the solid that are balls
[[nodiscard]] Excess excess(const Solid* solid, std::span<const Shape> balls,
                            std::span<const Shape> shapes);

/// Points spread evenly on a shape's surface (Fibonacci lattice), docs/theory.md (13.37).
struct SurfacePoints {
  std::vector<Eigen::Vector3d> points;
  double area_each_m2 = 0.0;  ///< surface area per point
};
[[nodiscard]] SurfacePoints surface_points(const Shape& shape, std::size_t count);

}  // namespace hamelin::fit

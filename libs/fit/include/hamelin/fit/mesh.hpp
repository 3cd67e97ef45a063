#pragma once
#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "hamelin/geometry/se3.hpp"

namespace hamelin::fit {

/// Triangles of a surface [m]. It need not be closed, oriented or free of overlaps.
struct Mesh {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::array<std::int32_t, 3>> triangles;

  [[nodiscard]] Eigen::Vector3d corner(std::size_t triangle, std::size_t k) const {
    return vertices[static_cast<std::size_t>(triangles[triangle][k])];
  }
};

/// Most triangles that a file may hold.
inline constexpr std::size_t triangles_max = 5'000'000;

/// How far the mesh of a cylinder may lie outside the cylinder [m], docs/theory.md (13.40); twice
/// that for a ball, (13.41). It never lies inside, so shapes that cover the mesh cover the solid.
inline constexpr double facet_error_m = 5e-5;

/// Reads STL, OBJ, COLLADA and other formats that assimp reads. The unit of a COLLADA file is
/// applied, its up-axis is ignored.
/// @param scale factors applied to the coordinates in the file
/// @throws Error io, parse or invalid: "file: what is wrong"
[[nodiscard]] Mesh load_mesh(const std::filesystem::path& file, const Eigen::Vector3d& scale);

/// A box about the origin. @param size full extents [m]
[[nodiscard]] Mesh box_mesh(const Eigen::Vector3d& size);

/// The prism around a cylinder about the origin, along z [m].
[[nodiscard]] Mesh cylinder_mesh(double radius, double length);

/// A polyhedron around a ball [m].
[[nodiscard]] Mesh ball_mesh(const Eigen::Vector3d& center, double radius);

/// Adds the triangles of `other`, moved by `pose`.
void append(Mesh& mesh, const Mesh& other, const geometry::SE3& pose = {});

}  // namespace hamelin::fit

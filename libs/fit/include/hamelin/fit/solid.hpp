#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "hamelin/fit/mesh.hpp"
#include "hamelin/fit/triangle_tree.hpp"

namespace hamelin::fit {

/// The solid that a surface bounds: distances, inside and outside, docs/theory.md (13.27)–(13.30).
/// Inside are the points that the outside cannot reach on a grid without crossing a triangle, so
/// cavities count as inside and neither orientation nor overlaps matter. If the surface is not
/// closed, points with a winding number above ½ are inside, too. A point between walls so close
/// that no grid point fits between them is inside unless the outside is visible from it. Distances
/// are to the part of the surface that is visible from outside: walls of cavities and parts hidden
/// by overlapping bodies do not count.
class Solid {
 public:
  /// @param mesh at least one triangle with an area
  /// @param nodes approximate number of grid points
  explicit Solid(Mesh mesh, std::size_t nodes = 120'000);

  /// The surface as given to the constructor.
  [[nodiscard]] const Mesh& mesh() const noexcept { return mesh_; }
  /// Distance from the surface [m].
  [[nodiscard]] double distance(const Eigen::Vector3d& p) const;
  /// Distance from the surface, negative inside [m].
  [[nodiscard]] double signed_distance(const Eigen::Vector3d& p) const;
  /// Depth of p below the surface [m], negative outside: fast, interpolated on the grid.
  [[nodiscard]] double depth(const Eigen::Vector3d& p) const;
  /// The least depth along a segment, interpolated likewise.
  [[nodiscard]] double depth(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const;
  /// The least depth along a segment, by exact distances of points one grid step apart.
  [[nodiscard]] double exact_depth(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const;

  [[nodiscard]] double spacing() const noexcept { return spacing_; }  ///< of the grid [m]
  /// Whether each edge is passed equally often in both directions by the triangles around it.
  [[nodiscard]] bool closed() const noexcept { return closed_; }
  [[nodiscard]] double volume() const;  ///< [m³], docs/theory.md (13.39)
  [[nodiscard]] double area() const noexcept { return outer_.area(); }  ///< [m²]
  /// The grid points inside, or within one grid step of the surface, as thin bodies need.
  [[nodiscard]] std::vector<Eigen::Vector3d> inner_points() const;

 private:
  enum class Side : std::uint8_t { near, outside, inside };

  void fill_grid(std::size_t nodes);
  /// The smallest spacing for at most so many points, margin included.
  void place_grid(std::size_t nodes);
  /// Distances without sign, and which points are clear of the surface. @return the nearest points
  std::vector<Eigen::Vector3d> measure_distances();
  /// Tells the clear points outside from those inside.
  void find_outside();
  /// Calls f(i, j, k) for each grid point.
  template <class F>
  void each_point(const F& f) const;
  /// What of outer_ is visible from outside; none if all of it, or nothing, is.
  [[nodiscard]] std::optional<Mesh> visible_part() const;
  /// The side of the nearest grid point that is clear of the surface and visible from p; `near` if
  /// there is none.
  [[nodiscard]] Side visible_side(const Eigen::Vector3d& p, bool outside_only) const;
  [[nodiscard]] bool inside(const Eigen::Vector3d& p, const Eigen::Vector3d& nearest) const;
  [[nodiscard]] Eigen::Vector3d at(int i, int j, int k) const;
  [[nodiscard]] std::size_t index(int i, int j, int k) const;

  Mesh mesh_;
  TriangleTree outer_;  ///< the part visible from outside, perhaps cut smaller
  bool closed_ = false;
  double spacing_ = 0.0;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  Eigen::Vector3i size_ = Eigen::Vector3i::Zero();
  std::vector<float> field_;  ///< signed distance at the grid points [m]
  std::vector<Side> side_;
  std::vector<Eigen::Vector3i> offsets_;  ///< to grid points around one, nearest first
};

}  // namespace hamelin::fit

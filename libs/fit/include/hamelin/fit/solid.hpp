#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "hamelin/fit/mesh.hpp"
#include "hamelin/fit/shape.hpp"

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
  [[nodiscard]] double volume() const;                          ///< [m³], docs/theory.md (13.39)
  [[nodiscard]] double area() const noexcept { return area_; }  ///< [m²]
  /// The grid points inside, or within one grid step of the surface, as thin bodies need.
  [[nodiscard]] std::vector<Eigen::Vector3d> inner_points() const;

 private:
  struct Node {
    Eigen::Vector3d low, high;
    Eigen::Vector3d center, normal;  ///< centroid by area; sum of area times normal
    double radius = 0.0;             ///< of a ball about `center` that holds the triangles
    /// A leaf has a count > 0. The left child of any other node is the next node.
    std::int32_t first = 0, count = 0, right = 0;
  };
  enum class Side : std::uint8_t { near, outside, inside };

  void build_tree();
  std::int32_t build(std::size_t first, std::size_t last);
  void find_closed();
  /// Removes from outer_ what is not visible from outside. @return whether anything was removed
  [[nodiscard]] bool remove_hidden_triangles();
  /// The side of the nearest grid point that is clear of the surface and visible from p; `near` if
  /// there is none.
  [[nodiscard]] Side visible_side(const Eigen::Vector3d& p, bool outside_only) const;
  [[nodiscard]] bool blocked(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const;
  void fill_grid(std::size_t nodes);
  [[nodiscard]] Eigen::Vector3d closest(const Eigen::Vector3d& p, double within) const;
  [[nodiscard]] double winding(const Eigen::Vector3d& p) const;
  [[nodiscard]] bool inside(const Eigen::Vector3d& p, const Eigen::Vector3d& nearest) const;
  [[nodiscard]] Eigen::Vector3d at(int i, int j, int k) const;
  [[nodiscard]] std::size_t index(int i, int j, int k) const;

  Mesh mesh_;
  Mesh outer_;                       ///< the part visible from outside, perhaps cut smaller
  std::vector<std::int32_t> order_;  ///< triangles in the order of the tree's leaves
  std::vector<Node> tree_;
  double area_ = 0.0;
  bool closed_ = false;
  double spacing_ = 0.0;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  Eigen::Vector3i size_ = Eigen::Vector3i::Zero();
  std::vector<float> field_;  ///< signed distance at the grid points [m]
  std::vector<Side> side_;
  std::vector<Eigen::Vector3i> offsets_;  ///< to grid points around one, nearest first
};

}  // namespace hamelin::fit

#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "hamelin/fit/mesh.hpp"
#include "hamelin/fit/shape.hpp"

namespace hamelin::fit {

/// What a surface bounds: distances, inside and outside. Inside is what the outside cannot reach by a way that stays
/// clear of all triangles on a grid, so cavities count as inside and neither orientation nor overlaps matter; of a
/// surface that is not closed also what its winding number (Jacobson, Kavan, Sorkine 2013) puts inside. A point
/// between walls so close that no grid point fits is inside unless it sees the outside. Distances are to the surface
/// that the outside sees: walls of cavities and what overlapping parts hide do not count.
class Solid {
 public:
  /// @param mesh at least one triangle with an area
  /// @param nodes about how many points the grid may have
  explicit Solid(Mesh mesh, std::size_t nodes = 120'000);

  /// The surface as given.
  [[nodiscard]] const Mesh& mesh() const noexcept { return mesh_; }
  /// Distance from the surface [m].
  [[nodiscard]] double distance(const Eigen::Vector3d& p) const;
  /// The same, negative inside [m].
  [[nodiscard]] double signed_distance(const Eigen::Vector3d& p) const;
  /// How deep p lies inside [m], negative outside; from the grid, fast and as good as that is.
  [[nodiscard]] double depth(const Eigen::Vector3d& p) const;
  /// The least depth along a segment, likewise.
  [[nodiscard]] double depth(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const;
  /// The same by exact distances of points a grid step apart.
  [[nodiscard]] double exact_depth(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const;

  [[nodiscard]] double spacing() const noexcept { return spacing_; }  ///< of the grid [m]
  [[nodiscard]] bool closed() const noexcept { return closed_; }      ///< each edge has as many triangles to each side
  [[nodiscard]] double volume() const;                                ///< [m³], from the grid
  [[nodiscard]] double area() const noexcept { return area_; }        ///< [m²]
  /// The grid's points that lie inside, or so near the surface that it matters for thin things.
  [[nodiscard]] std::vector<Eigen::Vector3d> inner_points() const;

 private:
  struct Node {
    Eigen::Vector3d low, high;
    Eigen::Vector3d center, normal;                ///< centroid by area; sum of area times normal
    double radius = 0.0;                           ///< of a ball about `center` that holds the triangles
    std::int32_t first = 0, count = 0, right = 0;  ///< a leaf has a count; else the left child is the next node
  };
  enum class Side : std::uint8_t { near, outside, inside };

  void build_tree();
  std::int32_t build(std::size_t first, std::size_t last);
  void find_closed();
  [[nodiscard]] bool drop_hidden();
  /// The side of the nearest point of the grid that is clear of the surface and in sight; `near` if there is none.
  [[nodiscard]] Side seen_from(const Eigen::Vector3d& p, bool outside_only) const;
  [[nodiscard]] bool blocked(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const;
  void fill_grid(std::size_t nodes);
  [[nodiscard]] Eigen::Vector3d closest(const Eigen::Vector3d& p, double within) const;
  [[nodiscard]] double winding(const Eigen::Vector3d& p) const;
  [[nodiscard]] bool inside(const Eigen::Vector3d& p, const Eigen::Vector3d& nearest) const;
  [[nodiscard]] Eigen::Vector3d at(int i, int j, int k) const;
  [[nodiscard]] std::size_t index(int i, int j, int k) const;

  Mesh mesh_;
  Mesh outer_;                       ///< what of it the outside sees, perhaps in smaller triangles
  std::vector<std::int32_t> order_;  ///< triangles as the tree's leaves hold them
  std::vector<Node> tree_;
  double area_ = 0.0;
  bool closed_ = false;
  double spacing_ = 0.0;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  Eigen::Vector3i size_ = Eigen::Vector3i::Zero();
  std::vector<float> field_;  ///< signed distance at the grid's points
  std::vector<Side> side_;
  std::vector<Eigen::Vector3i> around_;  ///< steps on the grid, nearest first
};

}  // namespace hamelin::fit

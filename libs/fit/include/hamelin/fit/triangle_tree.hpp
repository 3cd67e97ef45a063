#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "hamelin/fit/mesh.hpp"

namespace hamelin::fit {

/// The triangles of a mesh that have an area, in a tree of boxes.
class TriangleTree {
 public:
  /// @throws Error invalid if no triangle has an area
  explicit TriangleTree(Mesh mesh);

  [[nodiscard]] const Mesh& mesh() const noexcept { return mesh_; }
  /// The triangles that have an area.
  [[nodiscard]] const std::vector<std::int32_t>& triangles() const noexcept { return order_; }
  [[nodiscard]] double area() const noexcept { return area_; }  ///< [m²]
  /// Opposite corners of the box around the triangles.
  [[nodiscard]] const Eigen::Vector3d& low() const noexcept { return nodes_.front().low; }
  [[nodiscard]] const Eigen::Vector3d& high() const noexcept { return nodes_.front().high; }

  /// The nearest point of the triangles, if it is within a distance; else infinity.
  [[nodiscard]] Eigen::Vector3d closest(const Eigen::Vector3d& p, double within) const;
  /// The absolute winding number, docs/theory.md (13.28)–(13.30).
  [[nodiscard]] double winding(const Eigen::Vector3d& p) const;
  /// Whether a triangle crosses the segment, except for its first thousandth.
  [[nodiscard]] bool blocked(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const;

 private:
  struct Node {
    Eigen::Vector3d low, high;
    Eigen::Vector3d center, normal;  ///< centroid by area; sum of area times normal
    double radius = 0.0;             ///< of a ball about `center` that holds the triangles
    /// A leaf has a count > 0. The left child of any other node is the next node.
    std::int32_t first = 0, count = 0, right = 0;
  };

  std::int32_t build(std::size_t first, std::size_t last);

  Mesh mesh_;
  std::vector<std::int32_t> order_;  ///< triangles in the order of the tree's leaves
  std::vector<Node> nodes_;
  double area_ = 0.0;
};

}  // namespace hamelin::fit

#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "hamelin/scene/distance.hpp"
#include "hamelin/scene/map_file.hpp"

namespace hamelin::scene {

class MapSurface;

/// Signed distances to the union of one kind of a map's cells (occupied or unknown), in the map's
/// frame [m], by merged boxes in a tree.
/// Inside the union, distances are minus the exact depth below its surface, docs/theory.md (11.5),
/// and the direction is the exit direction. Cells can be added and removed by change(). All other
/// calls are const and may run on several threads, each with a Scratch of its own.
class MapField {
 public:
  /// Nearest points per sphere or capsule. Directions within 30° of that of a nearer point count as
  /// the same obstacle.
  static constexpr std::size_t points_max = 3;

  MapField();
  /// @param cells disjoint, in voxels
  /// @param resolution edge of a voxel [m]
  /// @param origin a point near the expected queries
  MapField(const std::vector<Cell>& cells, double resolution, const Eigen::Vector3d& origin);
  /// A copy can be changed while queries run on the original. It computes its surface when that is
  /// first needed.
  MapField(const MapField& other);
  MapField(MapField&&) noexcept;
  MapField& operator=(const MapField&) = delete;
  MapField& operator=(MapField&&) noexcept;
  ~MapField();

  [[nodiscard]] bool empty() const noexcept { return boxes_.empty(); }
  /// The merged boxes, disjoint, with the union of the cells. Some may have been removed, see
  /// BoxField::alive.
  [[nodiscard]] const BoxField& boxes() const noexcept { return boxes_; }

  struct Changed {
    std::size_t added = 0, removed = 0;  ///< voxels whose state is different now
  };
  /// Removes voxels, then adds others. Boxes are cut where voxels are removed, and the new boxes
  /// get a tree of their own, so the first tree is not built again. The boxes of each list are
  /// disjoint, but may overlap those of the other list and the boxes of the field.
  Changed change(const std::vector<VoxelBox>& add, const std::vector<VoxelBox>& remove);

  class Scratch {
   public:
    Scratch() = default;
    explicit Scratch(const MapField& field) : boxes_(field.boxes_) {}

   private:
    friend class MapField;
    BoxField::Scratch boxes_;
  };

  /// The nearest point of the surface, seen from p and no farther than `limit`. @param hint see
  /// BoxField::nearest
  /// @return whether there is one; `hit` is unchanged if not. No allocation, except at the first
  ///        query inside within some voxels.
  [[nodiscard]] bool nearest(const Eigen::Vector3d& p, double limit, BoxHit& hit,
                             std::int32_t hint = -1) const;
  /// The same, seen from a capsule's axis, the segment from a to b. If the axis enters the union,
  /// it is seen from its deepest point, to within 1e-10 m (or after 500 samples,
  /// docs/theory.md (11.13)).
  [[nodiscard]] bool nearest(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double limit,
                             SegmentHit& hit, std::int32_t hint = -1) const;

  /// Distance of the segment from a to b, zero if it enters the union, or `limit` if that is less.
  /// @param hint see BoxField::nearest; becomes the nearest box if there is one within the limit
  [[nodiscard]] double distance(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double limit,
                                std::int32_t& hint) const;

  /// Nearest points in distinct directions no farther than `limit`, nearest first; inside the union
  /// only the one in the exit direction. @return how many. No allocation, except at the first query
  /// inside. @param vicinity see BoxField::Vicinity, or null
  std::size_t nearest_distinct(const Eigen::Vector3d& p, double limit, Scratch& scratch,
                               std::span<BoxHit, points_max> out,
                               BoxField::Vicinity* vicinity = nullptr) const;
  /// The same, seen from a capsule's axis; points more than a third of the axis apart are distinct,
  /// too.
  std::size_t nearest_distinct(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double limit,
                               Scratch& scratch, std::span<SegmentHit, points_max> out,
                               BoxField::Vicinity* vicinity = nullptr) const;

  /// Computes now what the first queries inside would compute, so that no query allocates or waits.
  void prepare() const;

  /// Memory in use.
  [[nodiscard]] std::size_t bytes() const noexcept { return boxes_.bytes(); }

 private:
  /// Distance and exit direction of a point in the union or on its surface.
  void find_exit(const Eigen::Vector3d& p, BoxHit& hit) const;
  void find_deepest(const Eigen::Vector3d& a, const Eigen::Vector3d& b, SegmentHit& hit) const;

  double resolution_ = 0.0;
  BoxField boxes_;
  std::unique_ptr<MapSurface> surface_;
};

}  // namespace hamelin::scene

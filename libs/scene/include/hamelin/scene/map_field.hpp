#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "hamelin/scene/distance.hpp"
#include "hamelin/scene/map_file.hpp"

namespace hamelin::scene {

/// Signed distances to the union of one kind of a map's cells (occupied, or unknown), in the map's frame [m]: merged
/// boxes in a tree, and a table that tells by one look where nothing is near. Inside the union they are minus the exact
/// depth below its surface, with the way out as direction. Cells can be added and taken out. Otherwise const and shared
/// between threads; each brings a Scratch.
class MapField {
 public:
  /// Nearest points per sphere or capsule; directions within 30° of a nearer one's are the same obstacle.
  static constexpr std::size_t points_max = 3;

  MapField() = default;
  /// @param cells disjoint, in voxels
  /// @param resolution edge of a voxel [m]
  /// @param reachable where it will be asked mostly
  MapField(const std::vector<Cell>& cells, double resolution, const Ball& reachable);

  [[nodiscard]] bool empty() const noexcept { return boxes_.empty(); }
  /// The merged boxes, disjoint, with the union of the cells; only those that are alive.
  [[nodiscard]] const BoxField& boxes() const noexcept { return boxes_; }

  struct Changed {
    std::size_t added = 0, removed = 0;  ///< voxels that were not what they are now
  };
  /// Takes voxels out, then adds others, without building all anew: boxes are cut where something is taken out of them,
  /// and what is new gets a tree of its own. Either are disjoint, but may
  /// lie anywhere, also on the others.
  Changed change(const std::vector<VoxelBox>& add, const std::vector<VoxelBox>& remove);

  class Scratch {
   public:
    Scratch() = default;
    explicit Scratch(const MapField& field) : boxes_(field.boxes_) {}

   private:
    friend class MapField;
    BoxField::Scratch boxes_;
  };

  /// The nearest point of the surface no farther than `limit`, seen from p. @param hint see BoxField::nearest
  /// @return whether there is one; `hit` is left alone if not. No allocation.
  [[nodiscard]] bool nearest(const Eigen::Vector3d& p, double limit, BoxHit& hit, std::int32_t hint = -1) const;
  /// The same, seen from a capsule's axis, the segment from a to b: from its deepest point, within 1e-10 m, where it is
  /// inside anywhere.
  [[nodiscard]] bool nearest(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double limit, SegmentHit& hit,
                             std::int32_t hint = -1) const;

  /// Nearest points in different directions no farther than `limit`, nearest first; inside only the one way out.
  /// @return how many. No allocation but where the depth is asked for the first time.
  std::size_t several(const Eigen::Vector3d& p, double limit, Scratch& scratch,
                      std::span<BoxHit, points_max> out) const;
  /// The same, seen from a capsule's axis; points more than a third of it apart count as different, too.
  std::size_t several(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double limit, Scratch& scratch,
                      std::span<SegmentHit, points_max> out) const;

  /// Memory that it holds.
  [[nodiscard]] std::size_t bytes() const noexcept { return boxes_.bytes() + near_.bytes(); }

 private:
  /// The union's surface; made when something is inside for the first time.
  struct Surface {
    std::once_flag made;
    BoxField faces;
  };
  [[nodiscard]] const BoxField& faces() const;
  /// From a point in the union, or on its surface.
  void find_way_out(const Eigen::Vector3d& p, BoxHit& hit) const;
  void find_deepest(const Eigen::Vector3d& a, const Eigen::Vector3d& b, SegmentHit& hit) const;
  [[nodiscard]] std::vector<VoxelBox> voxel_boxes(std::size_t from) const;

  double resolution_ = 0.0;
  Ball reachable_;
  BoxField boxes_;
  NearTable near_;
  std::unique_ptr<Surface> surface_;
};

}  // namespace hamelin::scene

#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "hamelin/scene/distance.hpp"
#include "hamelin/scene/map_file.hpp"

namespace hamelin::scene {

/// Distances to one kind of a map's cells (occupied, or unknown), in the map's frame [m]: merged boxes in a tree, and
/// a table that tells by one look where nothing is near. Const and shared between threads; each brings a Scratch.
class MapField {
 public:
  /// Nearest points per sphere or capsule; directions within 30° of a nearer one's are the same obstacle.
  static constexpr std::size_t points_max = 3;

  MapField() = default;
  /// @param cells disjoint, in voxels
  /// @param resolution edge of a voxel [m]
  /// @param reachable where it will be asked mostly
  /// @param far the largest distance that matters often: far beyond it bounds are coarse [m]
  MapField(const std::vector<Cell>& cells, double resolution, const Ball& reachable, double far);

  [[nodiscard]] bool empty() const noexcept { return boxes_.empty(); }
  /// The merged boxes, disjoint, with the union of the cells.
  [[nodiscard]] const BoxField& boxes() const noexcept { return boxes_; }

  class Scratch {
   public:
    Scratch() = default;
    explicit Scratch(const MapField& field) : boxes_(field.boxes_) {}

   private:
    friend class MapField;
    BoxField::Scratch boxes_;
  };

  /// The nearest point no farther than `limit`. @param hint see BoxField::nearest
  /// @return whether there is one; `hit` is left alone if not. No allocation.
  [[nodiscard]] bool nearest(const Eigen::Vector3d& p, double limit, BoxHit& hit, std::int32_t hint = -1) const {
    return !far_.beyond(p, limit) && boxes_.nearest(p, limit, hit, hint);
  }

  /// Nearest points in different directions no farther than `limit`, nearest first. @return how many. No allocation.
  std::size_t several(const Eigen::Vector3d& p, double limit, Scratch& scratch,
                      std::span<BoxHit, points_max> out) const;

 private:
  BoxField boxes_;
  FarTable far_;
};

}  // namespace hamelin::scene

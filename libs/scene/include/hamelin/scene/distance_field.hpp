#pragma once
#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "hamelin/scene/boxes.hpp"

namespace hamelin::scene {

/// A grid of voxels that are occupied or not, in a box; everything outside of it is free.
class VoxelGrid {
 public:
  VoxelGrid() = default;
  explicit VoxelGrid(const VoxelBox& box);

  [[nodiscard]] const VoxelBox& box() const noexcept { return box_; }
  /// Sets the voxels of a box; those outside of the grid are ignored.
  /// @param changed receives (row y, row z, word, bits) of voxels that were different
  template <class Changed>
  void set(const VoxelBox& voxels, bool occupied, const Changed& changed);
  void set(const VoxelBox& voxels);
  void clear(const VoxelBox& voxels);
  /// Whether any voxel of a box is occupied.
  [[nodiscard]] bool any(const VoxelBox& voxels) const;
  /// Sets all voxels that are occupied in another grid whose box is within this one.
  void copy(const VoxelGrid& other);
  /// The smallest box that holds all occupied voxels; an empty one if there is none.
  [[nodiscard]] VoxelBox bounds() const;
  /// The 64 voxels of a row from x = box().lo[0] + 64 word on; zero outside of the grid.
  [[nodiscard]] std::uint64_t word(std::int32_t word, std::int32_t y, std::int32_t z) const;
  [[nodiscard]] std::size_t bytes() const noexcept { return bits_.size() * sizeof(std::uint64_t); }

 private:
  /// The first and the last word of the rows of a box that is within the grid, and the bits of one
  /// of them.
  [[nodiscard]] std::pair<std::int32_t, std::int32_t> words_of(const VoxelBox& inside) const;
  [[nodiscard]] std::uint64_t bits_of(const VoxelBox& inside, std::int32_t word) const;
  [[nodiscard]] std::size_t row(std::int32_t y, std::int32_t z) const noexcept {
    return static_cast<std::size_t>((z - box_.lo[2]) * (box_.hi[1] - box_.lo[1]) + y - box_.lo[1]) *
           static_cast<std::size_t>(words_);
  }

  VoxelBox box_;
  std::int32_t words_ = 0;  ///< per row along x
  std::vector<std::uint64_t> bits_;
};

/// Distances from a union of voxels at the corners of voxels, up to 25 voxels, from which lower
/// bounds of the distance anywhere follow with one look-up or eight: docs/theory.md (17.6)–(17.9).
/// The box of its nodes holds all voxels and 8 more on each side. Const calls may run on several
/// threads.
class DistanceField {
 public:
  static constexpr int cap_voxels = 25, pad_voxels = 8;
  /// Of distances and voxels. A union that needs more has no field.
  static constexpr std::size_t bytes_max = std::size_t{64} << 20U;

  /// Of no voxels: everything is as far away as it can tell.
  DistanceField() = default;
  /// @param occupied boxes, which may overlap @param resolution_m edge of a voxel
  /// @return none if it would need more than bytes_max
  [[nodiscard]] static std::optional<DistanceField> make(std::span<const VoxelBox> occupied,
                                                         double resolution_m);

  /// Frees voxels, then occupies others, and computes the distances that this can change. The
  /// result is that of make() with the voxels that are occupied now, to the bit.
  /// @return false if it would need more than bytes_max; the field cannot be used then
  [[nodiscard]] bool change(std::span<const VoxelBox> free, std::span<const VoxelBox> occupied);

  /// A lower bound of the distance of a point from all voxels [m]; zero inside of them.
  /// @param p in the map's frame [m]
  [[nodiscard]] double lower_bound(const Eigen::Vector3d& p) const;
  /// Whether a point is proved to be farther than that from all voxels; mostly by one look-up.
  [[nodiscard]] bool is_farther(const Eigen::Vector3d& p, double limit_m) const;
  /// The largest distance that it can tell [m].
  [[nodiscard]] double cap_m() const noexcept { return cap_voxels * resolution_; }

  /// What kernels read. A node is a corner of voxels.
  struct View {
    /// Distance of each node in units, rounded down, x first; two more numbers follow the last one.
    const std::uint16_t* values = nullptr;
    std::array<std::int32_t, 3> lo{}, count{};  ///< first node [voxels], and number of nodes
    double resolution_m = 0.0;                  ///< between nodes
    double unit_m = 0.0;                        ///< of the values
  };
  /// Its count is zero if there are no voxels.
  [[nodiscard]] View view() const noexcept;
  [[nodiscard]] bool empty() const noexcept { return values_.empty(); }
  [[nodiscard]] std::size_t bytes() const noexcept {
    return values_.size() * sizeof(std::uint16_t) + grid_.bytes();
  }

 private:
  class Dirty;
  DistanceField(VoxelGrid grid, const VoxelBox& used, double resolution_m);
  /// Makes room for voxels outside of the grid.
  [[nodiscard]] bool grow(std::span<const VoxelBox> occupied);
  /// Computes the distances of all nodes.
  void compute_all();
  /// Moves the box of the nodes to where it must be now. Those that were there before keep their
  /// values.
  void move_nodes();
  /// Computes the distances of the nodes of a box, and of more where its rows are short.
  void compute(VoxelBox to);
  struct Place;
  [[nodiscard]] Place place(const Eigen::Vector3d& p) const noexcept;
  [[nodiscard]] double bound_by_node(const Place& at) const noexcept;
  [[nodiscard]] double bound_by_cell(const Place& at) const noexcept;
  [[nodiscard]] std::size_t index(std::int32_t x, std::int32_t y, std::int32_t z) const noexcept {
    return static_cast<std::size_t>(
        (static_cast<std::int64_t>(z - nodes_.lo[2]) * (nodes_.hi[1] - nodes_.lo[1]) + y -
         nodes_.lo[1]) *
            (nodes_.hi[0] - nodes_.lo[0]) +
        x - nodes_.lo[0]);
  }

  double resolution_ = 0.0;
  VoxelGrid grid_;
  VoxelBox used_;   ///< the smallest box of the occupied voxels
  VoxelBox nodes_;  ///< [lo, hi)
  std::vector<std::uint16_t> values_;
};

}  // namespace hamelin::scene

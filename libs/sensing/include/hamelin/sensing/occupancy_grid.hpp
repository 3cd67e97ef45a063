#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "hamelin/scene/boxes.hpp"
#include "hamelin/sensing/kernel/ray_walk.hpp"

namespace hamelin::sensing {

/// How measurements change what is known of a voxel, as probabilities; the numbers of OctoMap.
struct SensorModel {
  double hit = 0.7, miss = 0.4;         ///< that a voxel is occupied, by one measurement
  double least = 0.1192, most = 0.971;  ///< what all measurements together tell at most
  double occupied = 0.5;                ///< a voxel with at least this counts as occupied
};

/// What is known of the voxels in a box, from points that a sensor saw: docs/theory.md (20.1). Rays
/// to the points free the voxels that they pass, and the points occupy theirs. The result is that
/// of OctoMap's OcTree::insertPointCloud() with `discretize`, voxel by voxel and to the bit; A.
/// Hornung et al., OctoMap, Autonomous Robots 34(3), 2013. One thread.
class OccupancyGrid {
 public:
  /// Voxels are counted from the origin of the map's frame.
  using Voxel = std::array<std::int32_t, 3>;
  enum class State : std::uint8_t { unknown, free, occupied };

  /// @param resolution_m edge of a voxel
  /// @param box that is kept; nothing is known of what is outside
  /// @throws Error invalid for a resolution or probabilities that make no sense, a box that is
  ///         empty, reaches beyond OctoMap's 2¹⁶ voxels per axis, or has more than 2³² of them
  OccupancyGrid(double resolution_m, const scene::VoxelBox& box, const SensorModel& model = {});
  ~OccupancyGrid();
  OccupancyGrid(OccupancyGrid&&) noexcept;
  OccupancyGrid& operator=(OccupancyGrid&&) noexcept;

  /// 64 voxels of a row along x, the first of which is at `first`; bit i stands for x + i.
  struct Row {
    Voxel first;
    std::uint64_t occupied = 0, freed = 0;  ///< that were not so before
    std::uint64_t learned = 0;              ///< that were unknown
  };
  /// Takes what was seen from a place.
  /// @param points 3 × N in the map's frame [m], finite
  /// @param origin of the rays, in the map's frame [m], finite and within OctoMap's 2¹⁶ voxels
  /// @param range_m of points that are farther only the way up to there is free
  /// @return the rows in which a state has changed, by z, y and x; valid until the next call
  std::span<const Row> insert(const Eigen::Ref<const Eigen::Matrix3Xf>& points,
                              const Eigen::Vector3f& origin,
                              double range_m = std::numeric_limits<double>::infinity());

  /// Unknown voxels next to those that the last insert() has freed, of which both neighbours along
  /// two axes are free: rays pass on both sides of such a voxel, and only by chance none through
  /// it, docs/theory.md (20.6). They stay unknown, as OctoMap leaves them.
  /// @return the rows in which there are some, as `freed`; valid until the next call
  std::span<const Row> gaps();

  /// Makes the part of a box that is within box() as well known as all measurements together can
  /// make it, or unknown.
  void set(const scene::VoxelBox& box, State state);

  /// The voxel of a point of the map's frame [m].
  [[nodiscard]] Voxel voxel_of(const Eigen::Vector3d& p) const noexcept;
  [[nodiscard]] State state(const Voxel& voxel) const;
  /// log(p/(1 − p)) for the probability p that it is occupied; NaN if nothing is known of it.
  [[nodiscard]] float log_odds(const Voxel& voxel) const;
  [[nodiscard]] const scene::VoxelBox& box() const noexcept { return box_; }
  [[nodiscard]] double resolution_m() const noexcept { return resolution_; }
  /// Memory in use.
  [[nodiscard]] std::size_t bytes() const noexcept;

 private:
  struct Block;
  class EndPoints;
  struct Bits {
    std::vector<std::uint64_t> words;
    void set(std::int64_t bit) noexcept {
      words[static_cast<std::size_t>(bit) / 64] |= std::uint64_t{1} << (bit % 64);
    }
  };
  struct LogOdds {
    float hit, miss, least, most, occupied;
  };

  [[nodiscard]] bool contains(const Voxel& voxel) const noexcept;
  [[nodiscard]] std::int64_t bit_of(const Voxel& voxel) const noexcept;
  void free_along(const Eigen::Vector3f& origin, const Eigen::Vector3f& end);
  void walk_rays();
  void mark(const Eigen::Ref<const Eigen::Matrix3Xf>& points, const Eigen::Vector3f& origin,
            double range_m);
  void apply();
  /// Of a row of words, by its place along y and z in the box: its voxels that are free; and those
  /// of one word that are unknown between free ones.
  [[nodiscard]] std::uint64_t free_in(std::int64_t word, std::int64_t y, std::int64_t z) const;
  [[nodiscard]] std::uint64_t gaps_in(std::int64_t word, std::int64_t y, std::int64_t z) const;
  /// Changes the log-odds of a row's voxels. @return those that are occupied now
  std::uint64_t update(std::size_t word, std::uint64_t free, std::uint64_t occupied);
  /// The log-odds of a voxel that no frame has told about.
  [[nodiscard]] float value_of(std::size_t word, std::uint64_t bit) const noexcept;
  /// Sets those of `mask`.
  void set(std::size_t word, std::uint64_t mask, State state);
  [[nodiscard]] Voxel first_of(std::size_t word) const noexcept;
  [[nodiscard]] std::size_t block_of(const Voxel& first) const noexcept;

  double resolution_;
  scene::VoxelBox box_;
  LogOdds model_;
  std::array<std::int64_t, 3> stride_{};  ///< between neighbours, in bits
  std::int32_t words_ = 0;                ///< per row
  std::array<std::size_t, 3> block_count_{};
  std::vector<std::unique_ptr<Block>> blocks_;
  Bits known_, occupied_, least_;  ///< least_: as free as it can be
  Bits passed_, hit_;              ///< by the rays of the frame
  std::unique_ptr<EndPoints> ends_;
  std::vector<kernel::BoxRay> rays_;
  std::vector<Row> rows_, gaps_;
};

}  // namespace hamelin::sensing

#pragma once
#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "hamelin/scene/boxes.hpp"
#include "hamelin/scene/kernel/box_tree.hpp"

namespace hamelin::scene {

/// The point of a box nearest to a query point.
struct BoxHit {
  double distance = 0.0;                                ///< [m]; inside the box: minus the depth below its nearest face
  std::int32_t box = -1;                                ///< index into BoxField::boxes()
  Eigen::Vector3d point = Eigen::Vector3d::Zero();      ///< on the box's surface
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< unit, from the point towards the query; inside: the way out
};

/// The pair of nearest points of a box and the axis of a capsule, the segment from a to b.
struct SegmentHit : BoxHit {
  double along = 0.0;                                    ///< where on the axis: 0 at a, 1 at b
  Eigen::Vector3d axis_point = Eigen::Vector3d::Zero();  ///< a + along (b − a); `distance` is measured from here
};

/// Distance, closest point and direction from a point to one box. On the surface the direction is a face's normal.
[[nodiscard]] BoxHit closest_on_box(const Eigen::Vector3d& p, const Box& box);

/// The same for the segment from a to b, in closed form: the squared distance of the point at t is convex and piecewise
/// quadratic, its derivative is known at the crossings of the six face planes, and linear between two of them. Where
/// the segment enters the box: its deepest point.
[[nodiscard]] SegmentHit closest_on_box(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Box& box);

/// Distances to a union of boxes: a tree of eight-wide nodes, bounds in single precision rounded outwards so that no
/// box is ever missed, the boxes themselves in double. Const and shared between threads.
class BoxField {
 public:
  BoxField() = default;
  /// @param boxes with disjoint interiors, lo < hi, one frame [m]
  /// @param origin where queries will be: bounds are tightest near it
  explicit BoxField(std::vector<Box> boxes, const Eigen::Vector3d& origin = Eigen::Vector3d::Zero());

  [[nodiscard]] const std::vector<Box>& boxes() const noexcept { return boxes_; }
  [[nodiscard]] bool empty() const noexcept { return boxes_.empty(); }
  /// Memory that it holds.
  [[nodiscard]] std::size_t bytes() const noexcept {
    return boxes_.capacity() * sizeof(Box) + nodes_.capacity() * sizeof(kernel::TreeNode) +
           slot_of_.capacity() * sizeof(std::int32_t);
  }

  /// Whether boxes()[box] still counts; see change().
  [[nodiscard]] bool alive(std::size_t box) const noexcept {
    return boxes_[box].lo.x() < std::numeric_limits<double>::infinity();
  }
  /// Takes out boxes for good, and puts `added` in the place of what was added last time. The tree of the first boxes
  /// stays, those that were added get one of their own below the same root: O(removed + added log added), until they
  /// are so many that all is built anew. Indices of boxes, and so hints, count for nothing afterwards.
  /// @param removed indices of boxes that are alive
  void change(std::span<const std::int32_t> removed, std::span<const Box> added);
  /// Indices of the boxes that were there from the start (or since all was built anew) come first; from here on: added.
  [[nodiscard]] std::size_t first_added() const noexcept { return first_added_; }
  /// Indices of all boxes that share more than a face with this one.
  void overlapping(const Box& box, std::vector<std::int32_t>& out) const;

  /// The nearest box no farther than `limit`, exact; among equals the one of lowest index.
  /// @param hint a box that may be near, e.g. the last answer for a point close by: its distance is the first bound,
  ///        the result does not depend on it; −1 for none
  /// @return whether there is one; `hit` is left alone if not. O(log n) typically, no allocation.
  [[nodiscard]] bool nearest(const Eigen::Vector3d& p, double limit, BoxHit& hit, std::int32_t hint = -1) const;
  /// The same for a capsule's axis, the segment from a to b; of several boxes that it enters, one of them.
  [[nodiscard]] bool nearest(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double limit, SegmentHit& hit,
                             std::int32_t hint = -1) const;

  /// Room for several(); one per thread.
  class Scratch {
   public:
    Scratch() = default;
    explicit Scratch(const BoxField& field) { fit(field); }

   private:
    friend class BoxField;
    void fit(const BoxField& field) {
      const std::size_t most = field.nodes_.size() + field.boxes_.size();
      if (room_.size() < most) room_.resize(most);
    }
    std::vector<kernel::Waiting> room_;
  };

  static constexpr std::size_t several_max = 8;

  /// Nearest boxes no farther than `limit`, nearest first, up to out.size() and several_max. A box is left out if its
  /// direction makes an angle with cosine above `cone_cosine` with one already taken: a floor of many boxes is one
  /// obstacle.
  /// @return how many were written. No allocation if the scratch was made for this field.
  std::size_t several(const Eigen::Vector3d& p, double limit, double cone_cosine, Scratch& scratch,
                      std::span<BoxHit> out) const;
  /// The same for a capsule's axis. Points more than a third of it apart are two, whatever their directions.
  std::size_t several(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double limit, double cone_cosine,
                      Scratch& scratch, std::span<SegmentHit> out) const;

 private:
  [[nodiscard]] kernel::Tree tree() const noexcept;
  [[nodiscard]] std::int32_t usable(std::int32_t hint) const noexcept {
    return static_cast<std::size_t>(hint) < boxes_.size() && alive(static_cast<std::size_t>(hint)) ? hint : -1;
  }
  void build_all();

  std::vector<Box> boxes_;
  std::vector<kernel::TreeNode> nodes_;  ///< the root is the first
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  const kernel::TreeKernels* kernels_ = nullptr;
  std::size_t first_added_ = 0, first_added_node_ = 0;
  std::vector<std::int32_t> slot_of_;  ///< 8 node + slot of each box
};

/// Where a field's nearest box is from the middle of each cell of a coarse grid over a ball; found out when a cell is
/// first asked for. As distances differ by no more than the points do, it tells by one look where nothing is near, and
/// never errs to the unsafe side; and it hints at the nearest box. Const and shared between threads: whoever comes
/// first writes what anyone would.
class NearTable {
 public:
  NearTable() = default;
  /// @param region where it will be asked; elsewhere it knows nothing
  /// @param edge of a cell [m], made larger if there were more than 10⁶ of them
  NearTable(const Ball& region, double edge);

  struct Answer {
    float lower = 0.0F;  ///< no box is nearer [m]
    std::int32_t hint = -1;
  };
  /// @param field always the same; boxes may have been taken out of it since
  [[nodiscard]] Answer ask(const BoxField& field, const Eigen::Vector3d& p) const;

  /// To be called when boxes were added to the field: cells are found out anew.
  void forget();

  [[nodiscard]] std::size_t bytes() const noexcept { return cells_.capacity() * sizeof(std::uint64_t); }

 private:
  Eigen::Vector3d low_ = Eigen::Vector3d::Zero();
  double edge_ = 0.0, per_edge_ = 0.0;
  std::size_t count_ = 0;  ///< along each axis
  /// Each a float, the distance from the cell's middle less a hair for all rounding, and above it a box's index plus
  /// one; zero where nobody asked yet.
  mutable std::vector<std::uint64_t> cells_;
};

}  // namespace hamelin::scene

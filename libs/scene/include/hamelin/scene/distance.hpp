#pragma once
#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "hamelin/scene/boxes.hpp"
#include "hamelin/scene/kernel/box_tree.hpp"

namespace hamelin::scene {

/// The point of a box nearest to a query point.
struct BoxHit {
  double distance = 0.0;  ///< [m]; inside: minus the depth below the nearest face
  std::int32_t box = -1;  ///< index into BoxField::boxes()
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< on the box's surface
  /// Unit, from `point` to the query; inside: exit direction.
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
};

/// The pair of nearest points of a box and the axis of a capsule, the segment from a to b.
struct SegmentHit : BoxHit {
  double along = 0.0;  ///< position on the axis: 0 at a, 1 at b
  /// The point a + along (b − a); `distance` is measured from here.
  Eigen::Vector3d axis_point = Eigen::Vector3d::Zero();
};

/// Distance, closest point and direction from a point to one box, docs/theory.md (11.1)–(11.3). On
/// the surface the direction is the normal of a face.
[[nodiscard]] BoxHit closest_on_box(const Eigen::Vector3d& p, const Box& box);

/// The same for the segment from a to b, in closed form, docs/theory.md (11.9), (11.10). If the
/// segment enters the box, the result is its deepest point, docs/theory.md (11.11).
[[nodiscard]] SegmentHit closest_on_box(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                        const Box& box);

/// Distances to a union of boxes, docs/theory.md (11.4): a tree of nodes with eight children.
/// Bounds are in single precision and rounded outwards, so the nearest box is never missed; the
/// boxes themselves are in double precision. Const queries may run on several threads.
class BoxField {
 public:
  BoxField() = default;
  /// @param boxes with disjoint interiors, lo < hi, one frame [m]
  /// @param origin a point near the expected queries: bounds are tightest there
  explicit BoxField(std::vector<Box> boxes,
                    const Eigen::Vector3d& origin = Eigen::Vector3d::Zero());

  [[nodiscard]] const std::vector<Box>& boxes() const noexcept { return boxes_; }
  [[nodiscard]] bool empty() const noexcept { return boxes_.empty(); }
  /// Memory in use.
  [[nodiscard]] std::size_t bytes() const noexcept {
    return boxes_.capacity() * sizeof(Box) + nodes_.capacity() * sizeof(kernel::TreeNode) +
           slot_of_.capacity() * sizeof(std::int32_t);
  }

  /// Whether boxes()[box] has not been removed; see change().
  [[nodiscard]] bool alive(std::size_t box) const noexcept {
    return boxes_[box].lo.x() < std::numeric_limits<double>::infinity();
  }
  /// Calls `f(box)` for each box that has not been removed.
  template <class F>
  void for_each_alive(F&& f) const {
    for (std::size_t i = 0; i < boxes_.size(); ++i)
      if (alive(i)) f(boxes_[i]);
  }
  /// Removes boxes permanently and replaces all boxes that earlier calls added by `added`. The tree
  /// of the first boxes is kept, and the added boxes get a second tree below the same root:
  /// O(removed + added log added). If there are too many of them, one tree is built from all boxes.
  /// Indices of boxes, and so hints, are invalid afterwards.
  /// @param removed indices of boxes that are alive
  void change(std::span<const std::int32_t> removed, std::span<const Box> added);
  /// Index of the first added box; the boxes before it are those of the first tree.
  [[nodiscard]] std::size_t first_added() const noexcept { return first_added_; }
  /// Writes the indices of all boxes that share more than a face with this one, in ascending order.
  void overlapping(const Box& box, std::vector<std::int32_t>& out) const;

  /// The nearest box no farther than `limit`, exact; among equally near boxes the one of lowest
  /// index.
  /// @param hint a box that may be near, for example the last answer for a point close by: its
  ///        distance is the first bound, but the result does not depend on it; −1 for none
  /// @return whether there is one; `hit` is unchanged if not. O(log n) typically, no allocation.
  [[nodiscard]] bool nearest(const Eigen::Vector3d& p, double limit, BoxHit& hit,
                             std::int32_t hint = -1) const;
  /// The same for a capsule's axis, the segment from a to b. If it enters several boxes, one of
  /// them is the result.
  [[nodiscard]] bool nearest(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double limit,
                             SegmentHit& hit, std::int32_t hint = -1) const;

  /// The boxes around a query that moves little from call to call, such as one shape of an arm: as
  /// long as they include all that are near enough, nearest_distinct() looks at no others. The
  /// results are the same to the bit. One per query and thread; for any field, one after the other.
  class Vicinity {
   public:
    /// Allocates all memory that it will use.
    /// @param skin_m how far the query may move before it gathers boxes again
    explicit Vicinity(double skin_m = 0.01)
        : skin_m_(skin_m), nodes_(std::make_unique_for_overwrite<kernel::TreeNode[]>(nodes_max)) {}

   private:
    friend class BoxField;
    static constexpr std::size_t nodes_max = 64;
    [[nodiscard]] bool covers(const BoxField& field, const Eigen::Vector3d& a,
                              const Eigen::Vector3d& b, double limit) const noexcept;
    void gather(const BoxField& field, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                double reach) noexcept;

    double skin_m_;
    std::uint64_t revision_ = 0;  ///< of the field; zero: of none
    Eigen::Vector3d a_ = Eigen::Vector3d::Zero(), b_ = Eigen::Vector3d::Zero();
    double reach_ =
        0.0;  ///< all boxes no farther than this from the segment from a_ to b_ are here
    int node_count_ = 0;  ///< −1: there are too many
    std::unique_ptr<kernel::TreeNode[]> nodes_;
  };

  /// Working memory of nearest_distinct(); one per thread.
  class Scratch {
   public:
    Scratch() = default;
    explicit Scratch(const BoxField& field) { fit(field); }

   private:
    friend class BoxField;
    void fit(const BoxField& field) {
      const std::size_t size = field.nodes_.size() + field.boxes_.size();
      if (queue_.size() < size) queue_.resize(size);
    }
    Vicinity once_;
    std::vector<kernel::QueueEntry> queue_;  ///< where there are more boxes than that holds
  };

  static constexpr std::size_t distinct_max = 8;

  /// Nearest boxes in distinct directions no farther than `limit`, nearest first, up to out.size()
  /// and distinct_max. A box is left out if the angle between its direction and that of an accepted
  /// one has a cosine above `cone_cosine`: a floor of many boxes is one obstacle. See
  /// docs/theory.md (11.22).
  /// @param vicinity that of the query, or null
  /// @return how many were written. No allocation if the scratch was made for this field.
  std::size_t nearest_distinct(const Eigen::Vector3d& p, double limit, double cone_cosine,
                               Scratch& scratch, std::span<BoxHit> out,
                               Vicinity* vicinity = nullptr) const;
  /// The same for a capsule's axis. Points more than a third of the axis apart are distinct for all
  /// directions.
  std::size_t nearest_distinct(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double limit,
                               double cone_cosine, Scratch& scratch, std::span<SegmentHit> out,
                               Vicinity* vicinity = nullptr) const;

 private:
  [[nodiscard]] kernel::Tree tree() const noexcept;
  [[nodiscard]] std::int32_t valid_hint(std::int32_t hint) const noexcept {
    return static_cast<std::size_t>(hint) < boxes_.size() && alive(static_cast<std::size_t>(hint))
               ? hint
               : -1;
  }
  void build_all();
  /// One tree of the boxes that are left and of the added ones.
  void rebuild(std::span<const Box> added);
  template <class From, class Hit>
  std::size_t nearest_distinct_of(const From& from, double limit, double cone_cosine,
                                  Scratch& scratch, std::span<Hit> out, Vicinity* vicinity) const;

  /// Different for different boxes, in the whole program; copies have the same.
  std::uint64_t revision_ = 0;
  std::vector<Box> boxes_;
  std::vector<kernel::TreeNode> nodes_;  ///< the root is the first
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  const kernel::TreeKernels* kernels_ = nullptr;
  std::size_t first_added_ = 0, first_added_node_ = 0;
  std::vector<std::int32_t> slot_of_;  ///< 8 node + slot of each box
};

}  // namespace hamelin::scene

#pragma once
#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "hamelin/scene/boxes.hpp"

namespace hamelin::scene {

/// The point of a box nearest to a query point.
struct BoxHit {
  double distance = 0.0;                                ///< [m]; inside the box: minus the depth below its nearest face
  std::int32_t box = -1;                                ///< index into BoxField::boxes()
  Eigen::Vector3d point = Eigen::Vector3d::Zero();      ///< on the box's surface
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< unit, from the point towards the query; inside: the way out
};

/// Distance, closest point and direction from a point to one box. On the surface the direction is a face's normal.
[[nodiscard]] BoxHit closest_on_box(const Eigen::Vector3d& p, const Box& box);

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

  /// The nearest box no farther than `limit`, exact; among equals the one of lowest index.
  /// @param hint a box that may be near, e.g. the last answer for a point close by: its distance is the first bound,
  ///        the result does not depend on it; −1 for none
  /// @return whether there is one; `hit` is left alone if not. O(log n) typically, no allocation.
  [[nodiscard]] bool nearest(const Eigen::Vector3d& p, double limit, BoxHit& hit, std::int32_t hint = -1) const;

  /// Room for several(); one per thread.
  class Scratch {
   public:
    Scratch() = default;
    explicit Scratch(const BoxField& field) { waiting_.reserve(field.nodes_.size() * width); }

   private:
    friend class BoxField;
    struct Entry {
      double key;          ///< squared distance; inside a box: minus the squared depth
      std::int32_t index;  ///< box if not negative, else −1 − node
    };
    std::vector<Entry> waiting_;
  };

  /// Nearest boxes no farther than `limit`, nearest first, up to out.size(). A box is left out if its direction makes
  /// an angle with cosine above `cone_cosine` with one already taken: a floor of many boxes is one obstacle.
  /// @return how many were written. No allocation if the scratch was made for this field.
  std::size_t several(const Eigen::Vector3d& p, double limit, double cone_cosine, Scratch& scratch,
                      std::span<BoxHit> out) const;

 private:
  static constexpr std::size_t width = 8;
  using Lanes = std::array<float, width>;
  struct alignas(32) Node {
    std::array<Lanes, 3> lo, hi;
    std::array<std::int32_t, width> child;  ///< node if not negative, else −1 − box
    std::int32_t count = 0;                 ///< slots in use, from the front
  };
  struct Query;

  std::int32_t build(std::span<std::int32_t> items, int depth);

  std::vector<Box> boxes_;
  std::vector<Node> nodes_;  ///< the root is the first
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
};

/// Tells by one look into a table that no box of a field is near: lower bounds of the distance at the centres of a
/// coarse grid over a ball, to which the distance of two points adds. It never errs to the unsafe side.
class FarTable {
 public:
  FarTable() = default;
  /// @param region where it will be asked; elsewhere it knows nothing
  /// @param edge of a cell [m], made larger if there were more than 2²⁰ of them
  /// @param exact_up_to farther than this the bounds are coarse [m]
  FarTable(const BoxField& field, const Ball& region, double edge, double exact_up_to);

  /// Whether every box is farther from p than `limit`; false also where that is not known.
  [[nodiscard]] bool beyond(const Eigen::Vector3d& p, double limit) const noexcept {
    if (bounds_.empty()) return false;
    const Eigen::Vector3d at = (p - low_) * per_edge_;
    for (int axis = 0; axis < 3; ++axis)
      if (!(at[axis] >= 0.0 && at[axis] < static_cast<double>(cells_))) return false;
    const auto x = static_cast<std::size_t>(at.x()), y = static_cast<std::size_t>(at.y()),
               z = static_cast<std::size_t>(at.z());
    const double room = static_cast<double>(bounds_[(x * cells_ + y) * cells_ + z]) - limit;
    const Eigen::Vector3d off(at.x() - static_cast<double>(x) - 0.5, at.y() - static_cast<double>(y) - 0.5,
                              at.z() - static_cast<double>(z) - 0.5);
    return room > 0.0 && off.squaredNorm() * edge_ * edge_ < room * room;
  }

 private:
  Eigen::Vector3d low_ = Eigen::Vector3d::Zero();
  double edge_ = 0.0, per_edge_ = 0.0;
  std::size_t cells_ = 0;      ///< along each axis
  std::vector<float> bounds_;  ///< [m], less a hair for all rounding
};

}  // namespace hamelin::scene

#pragma once
#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "hamelin/scene/boxes.hpp"
#include "hamelin/scene/kernel/box_tree.hpp"

/// The tree of a BoxField.
namespace hamelin::scene::box_tree {

inline constexpr float float_infinity = std::numeric_limits<float>::infinity();
inline constexpr std::size_t width = kernel::TreeNode::width;

[[nodiscard]] inline float round_down(double x) {
  const auto f = static_cast<float>(x);
  return static_cast<double>(f) > x ? std::nextafter(f, -float_infinity) : f;
}

[[nodiscard]] inline float round_up(double x) {
  const auto f = static_cast<float>(x);
  return static_cast<double>(f) < x ? std::nextafter(f, float_infinity) : f;
}

/// Appends the tree of these boxes and sorts them in its order, so that boxes near in space are
/// near in memory. Groups are split by the surface area heuristic over 16 bins of the box centres
/// on each axis, see docs/theory.md.
/// @param first index of the first box
/// @param slot_of receives, from entry `first` on, 8 node + slot of each box
void append(std::vector<Box>& boxes, std::size_t first, const Eigen::Vector3d& origin,
            std::vector<kernel::TreeNode>& nodes, std::vector<std::int32_t>& slot_of);

/// A root without children.
[[nodiscard]] kernel::TreeNode empty_root();

/// Adds a node as the next child of a root. Boxes of it that were removed, whose bounds are at
/// infinity, do not count.
void attach(kernel::TreeNode& root, const kernel::TreeNode& node, std::size_t index);

}  // namespace hamelin::scene::box_tree

#pragma once
#include <cstdint>

namespace hamelin::scene::kernel {

/// Bounds of eight children in single precision, rounded outwards, relative to the tree's origin.
struct alignas(32) TreeNode {
  static constexpr int width = 8;
  float lo[3][width], hi[3][width];
  std::int32_t child[width];  ///< a node if not negative, else −1 − box
  std::int32_t count;         ///< slots in use, from the front
};

/// A view of a tree, the argument of its kernels.
struct Tree {
  const TreeNode* nodes;  ///< the root is the first
  const double* boxes;    ///< six numbers per box: lo, hi
  double origin[3];
};

struct Found {
  double key = 0.0;  ///< squared distance; inside a box: minus the squared depth
  std::int32_t box = -1;
};

/// An entry of the best-first search: a child of a node with a lower bound of its key, or a box
/// with its exact key.
struct QueueEntry {
  double key;
  std::int32_t id;  ///< 8 · node + slot of a child; −1 − box for a box
};

/// The traversals, compiled for each instruction set. They never use fused multiply-add and perform
/// the same operations in every lane, so all instruction sets give the same bits.
struct TreeKernels {
  /// Finds the box with the least (key, index) among those with a key up to `limit`². The query is
  /// the segment from p to q, or the point p if q is null. On entry `found` holds the first
  /// candidate, or box −1.
  bool (*nearest)(const Tree& tree, const double* p, const double* q, double limit,
                  Found& found) noexcept;
  /// Nearest boxes in distinct directions, see BoxField::nearest_distinct.
  /// @param queue memory for as many entries as there are nodes and boxes @return how many were
  ///        found
  int (*nearest_distinct)(const Tree& tree, const double* p, const double* q, double limit,
                          double cone_cosine, QueueEntry* queue, Found* out, int count) noexcept;
  /// Copies all boxes that may be within `limit` to nodes without children, of which only the last
  /// is not full. @return the number of nodes, or −1 if `nodes_max` are too few
  int (*gather)(const Tree& tree, const double* p, const double* q, double limit, TreeNode* nodes,
                int nodes_max) noexcept;
  /// nearest_distinct() among boxes that gather() copied: the same result if they include all
  /// within `limit`. @param bounds memory for eight numbers per node
  int (*nearest_distinct_among)(const Tree& tree, const TreeNode* nodes, int node_count,
                                const double* p, const double* q, double limit, double cone_cosine,
                                float* bounds, Found* out, int count) noexcept;
};

}  // namespace hamelin::scene::kernel

#pragma once
#include <cstdint>

namespace hamelin::scene::kernel {

/// Eight boxes in single precision, rounded outwards, about the tree's origin.
struct alignas(32) TreeNode {
  static constexpr int width = 8;
  float lo[3][width], hi[3][width];
  std::int32_t child[width];  ///< a node if not negative, else −1 − box
  std::int32_t count;         ///< slots in use, from the front
};

/// A tree as its kernels see it.
struct Tree {
  const TreeNode* nodes;  ///< the root first
  const double* boxes;    ///< six numbers a box: lo, hi
  double origin[3];
};

struct Found {
  double key = 0.0;  ///< squared distance; inside a box: minus the squared depth
  std::int32_t box = -1;
};

/// What waits to be looked at, with a lower bound of its key.
struct Waiting {
  double key;
  std::int32_t id;  ///< 8 node + slot that it is in; or −1 − box, if its key is exact
};

/// The traversals, compiled for each instruction set. Products are never fused and lanes do what single numbers would:
/// all sets give the same bits.
struct TreeKernels {
  /// The box with the least (key, index) of all with a key up to `limit`²; the axis goes from p to q, or is the point p
  /// if q is null. `found` is the first candidate, or has box −1.
  bool (*nearest)(const Tree& tree, const double* p, const double* q, double limit, Found& found) noexcept;
  /// Nearest boxes, see BoxField::several. @param room for all nodes and boxes @return how many
  int (*several)(const Tree& tree, const double* p, const double* q, double limit, double cone_cosine, Waiting* room,
                 Found* out, int count) noexcept;
};

}  // namespace hamelin::scene::kernel

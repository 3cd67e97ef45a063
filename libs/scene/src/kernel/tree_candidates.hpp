#pragma once
#include <cstdint>

#include "float_lanes.hpp"
#include "hamelin/scene/kernel/box_tree.hpp"

/// Search among the boxes that may be near, which are copied once for queries that move little.
namespace hamelin::scene::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

// Copies all boxes that may be within `limit` to nodes without children.
// @return the number of nodes, or −1 if `nodes_max` are too few
template <class Query>
HAMELIN_INLINE int gather_of(const Tree& tree, const Query& query, double limit, TreeNode* out,
                             int nodes_max) {
  const float bound = bound_of(limit * limit);
  std::int32_t stack[512];  // see nearest_of()
  int waiting = 0, boxes = 0;
  stack[waiting++] = 0;
  alignas(32) float squares[width];
  while (waiting > 0) {
    const TreeNode& node = tree.nodes[stack[--waiting]];
    query.bounds(node, squares);
    unsigned near = not_above(squares, bound) & ((1U << static_cast<unsigned>(node.count)) - 1U);
    for (; near != 0; near &= near - 1U) {
      const int slot = __builtin_ctz(near);
      if (node.child[slot] >= 0) {
        stack[waiting++] = node.child[slot];
        continue;
      }
      if (boxes == nodes_max * width) return -1;
      TreeNode& to = out[boxes / width];
      const int at = boxes++ % width;
      for (int i = 0; i < 3; ++i) {
        to.lo[i][at] = node.lo[i][slot];
        to.hi[i][at] = node.hi[i][slot];
      }
      to.child[at] = node.child[slot];
      to.count = at + 1;
    }
  }
  return (boxes + width - 1) / width;
}

// Boxes that gather_of() copied, with a bound each, and those of their nodes that are still in use.
class Candidates {
 public:
  HAMELIN_INLINE Candidates(const TreeNode* nodes, int count, float* bounds) noexcept
      : nodes_(nodes), bounds_(bounds), count_(count) {
    for (int n = 0; n < count; ++n) active_[n] = static_cast<std::uint8_t>(n);
  }

  // Calls change(node, bounds) for all nodes, and forgets those without a bound up to `limit`.
  template <class Change>
  HAMELIN_INLINE void update(float limit, const Change& change) {
    int kept = 0;
    for (int i = 0; i < count_; ++i) {
      const int n = active_[i];
      float* const bounds = bounds_ + n * width;
      change(nodes_[n], bounds);
      active_[kept] = static_cast<std::uint8_t>(n);
      kept += not_above(bounds, limit) != 0 ? 1 : 0;
    }
    count_ = kept;
  }

  // Calls try_slot(slot) for each bound up to `limit`, which may fall meanwhile.
  template <class TrySlot>
  HAMELIN_INLINE void each(const float& limit, const TrySlot& try_slot) const {
    for (int i = 0; i < count_; ++i) {
      const int n = active_[i];
      for (unsigned near = not_above(bounds_ + n * width, limit); near != 0; near &= near - 1U)
        try_slot(n * width + __builtin_ctz(near));
    }
  }

  // The slot of the least bound; −1 if there is none.
  HAMELIN_INLINE int least() const {
    Lanes least = splat(infinity());
    for (int i = 0; i < count_; ++i)
      for (int half = 0; half < width; half += lanes)
        least = min(least, load(bounds_ + active_[i] * width + half));
    float smallest = infinity();
    for (int lane = 0; lane < lanes; ++lane)
      smallest = least[lane] < smallest ? least[lane] : smallest;
    if (!(smallest < infinity())) return -1;
    for (int i = 0; i < count_; ++i) {
      const unsigned here = not_above(bounds_ + active_[i] * width, smallest);
      if (here != 0) return active_[i] * width + __builtin_ctz(here);
    }
    return -1;
  }

  HAMELIN_INLINE void remove(int slot) { bounds_[slot] = infinity(); }
  HAMELIN_INLINE std::int32_t box(int slot) const {
    return -1 - nodes_[slot / width].child[slot % width];
  }

 private:
  const TreeNode* nodes_;
  float* bounds_;
  int count_;
  std::uint8_t active_[256];
};

// What nearest_distinct_of() finds, among boxes that gather_of() copied.
template <class Query>
HAMELIN_INLINE int nearest_distinct_among_of(const Tree& tree, const TreeNode* nodes,
                                             int node_count, const Query& query, double limit,
                                             double cone_cosine, float* bounds, Found* out,
                                             int count) {
  constexpr int most = 8;
  typename Query::Accepted accepted[most];
  const float limit_bound = bound_of(limit * limit), limit_f = static_cast<float>(limit),
              cosine = static_cast<float>(cone_cosine);
  Candidates candidates(nodes, node_count, bounds);
  candidates.update(
      limit_bound, [&](const TreeNode& node, float* of) __attribute__((always_inline)) {
        query.bounds(node, of);
        for (int slot = node.count; slot < width; ++slot) of[slot] = infinity();
      });
  int found = 0;
  while (found < count && found < most) {
    Found best{limit * limit, -1};
    int best_slot = -1;
    float bound = limit_bound;
    const auto try_slot = [&](int slot) __attribute__((always_inline)) {
      const std::int32_t box = candidates.box(slot);
      const double key = query.key(tree.boxes + 6 * static_cast<std::int64_t>(box));
      if (key < best.key || (key == best.key && (best.box < 0 || box < best.box))) {
        best = {key, box};
        best_slot = slot;
        bound = bound_of(key);
      }
    };
    // the box of the least bound first, then all that may be nearer
    const int first = candidates.least();
    if (first < 0) break;
    try_slot(first);
    candidates.each(bound, try_slot);
    if (best_slot < 0) break;
    candidates.remove(best_slot);
    const typename Query::Accepted hit =
        query.accept(tree.boxes + 6 * static_cast<std::int64_t>(best.box));
    bool duplicate = false;
    for (int i = 0; i < found; ++i)
      duplicate = duplicate || query.is_duplicate(accepted[i], hit, cone_cosine);
    if (duplicate) continue;
    accepted[found] = hit;
    out[found++] = best;
    if (cone_cosine > 0.0 && found < count)
      candidates.update(
          limit_bound, [&](const TreeNode& node, float* of) __attribute__((always_inline)) {
            query.drop_duplicates(node, hit, cosine, limit_f, of);
          });
  }
  return found;
}

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::scene::kernel

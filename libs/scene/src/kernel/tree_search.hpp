#pragma once
#include <cstdint>

#include "float_lanes.hpp"
#include "hamelin/scene/kernel/box_tree.hpp"

/// The searches that traverse a box tree. Query is Point or Segment, see tree_query.hpp.
namespace hamelin::scene::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

template <class Query>
HAMELIN_INLINE bool nearest_of(const Tree& tree, const Query& query, double limit, Found& found) {
  double best = limit * limit;
  std::int32_t best_box = -1;
  const auto try_box = [&](std::int32_t index) __attribute__((always_inline)) {
    const double key = query.key(tree.boxes + 6 * static_cast<std::int64_t>(index));
    const bool better = key < best || (key == best && (best_box < 0 || index < best_box));
    if (better) {
      best = key;
      best_box = index;
    }
    return better;
  };
  if (found.box >= 0) try_box(found.box);
  float bound = bound_of(best);

  struct Entry {
    float bound;
    std::int32_t node;
  };
  // At most 10 levels of heuristic cuts and 31 of halving, each of which leaves at most 7 siblings
  // on the stack.
  Entry stack[512];
  int waiting = 0;
  stack[waiting++] = {0.0F, 0};
  alignas(32) float squares[width];
  while (waiting > 0) {
    const Entry entry = stack[--waiting];
    if (entry.bound > bound) continue;
    const TreeNode& node = tree.nodes[entry.node];
    query.bounds(node, squares);
    unsigned near = not_above(squares, bound) & ((1U << static_cast<unsigned>(node.count)) - 1U);
    const int first = waiting;
    // Nearest box first: its distance usually excludes the others.
    for (;;) {
      int box_slot = -1;
      for (unsigned rest = near; rest != 0; rest &= rest - 1U) {
        const int slot = __builtin_ctz(rest);
        if (node.child[slot] < 0 && (box_slot < 0 || squares[slot] < squares[box_slot]))
          box_slot = slot;
      }
      if (box_slot < 0) break;
      near &= ~(1U << static_cast<unsigned>(box_slot));
      if (try_box(-1 - node.child[box_slot])) {
        bound = bound_of(best);
        near &= not_above(squares, bound);
      }
    }
    for (; near != 0; near &= near - 1U) {
      const int slot = __builtin_ctz(near);
      // the nearest child on top of the stack
      int at = waiting++;
      for (; at > first && stack[at - 1].bound < squares[slot]; --at) stack[at] = stack[at - 1];
      stack[at] = {squares[slot], node.child[slot]};
    }
  }
  if (best_box < 0) return false;
  found = {best, best_box};
  return true;
}

// Nodes before boxes, then boxes by index.
HAMELIN_INLINE bool before(const QueueEntry& a, const QueueEntry& b) {
  return a.key < b.key || (a.key == b.key && a.id > b.id);
}

HAMELIN_INLINE void push(QueueEntry* heap, int& size, const QueueEntry& entry) {
  int at = size++;
  while (at > 0) {
    const int parent = (at - 1) / 2;
    if (!before(entry, heap[parent])) break;
    heap[at] = heap[parent];
    at = parent;
  }
  heap[at] = entry;
}

HAMELIN_INLINE QueueEntry pop(QueueEntry* heap, int& size) {
  const QueueEntry top = heap[0];
  const QueueEntry last = heap[--size];
  int at = 0;
  for (int child = 1; child < size; child = 2 * at + 1) {
    if (child + 1 < size && before(heap[child + 1], heap[child])) ++child;
    if (!before(heap[child], last)) break;
    heap[at] = heap[child];
    at = child;
  }
  heap[at] = last;
  return top;
}

template <class Query>
HAMELIN_INLINE int nearest_distinct_of(const Tree& tree, const Query& query, double limit,
                                       double cone_cosine, QueueEntry* heap, Found* out,
                                       int count) {
  constexpr int most = 8;
  typename Query::Accepted accepted[most];
  const double limit2 = limit * limit;
  const float bound = bound_of(limit2);
  const float cosine = static_cast<float>(cone_cosine);
  // (11.23) holds for cones of less than a right angle only; for others no child is skipped early
  const float sine = cone_cosine > 0.0 ? __builtin_sqrtf(1.0F - cosine * cosine) : 0.0F;
  int found = 0, size = 0;
  const auto hidden = [&](const TreeNode& node, int slot) __attribute__((always_inline)) {
    for (int i = 0; i < found; ++i)
      if (query.hidden(node, slot, accepted[i], cosine, sine)) return true;
    return false;
  };
  alignas(32) float squares[width];
  const auto open = [&](std::int32_t index) __attribute__((always_inline)) {
    const TreeNode& node = tree.nodes[index];
    query.bounds(node, squares);
    unsigned near = not_above(squares, bound) & ((1U << static_cast<unsigned>(node.count)) - 1U);
    for (; near != 0; near &= near - 1U) {
      const int slot = __builtin_ctz(near);
      if (node.child[slot] < 0 || !hidden(node, slot))
        push(heap, size, {static_cast<double>(squares[slot]), index * width + slot});
    }
  };
  open(0);
  while (size > 0 && found < count && found < most) {
    QueueEntry next = pop(heap, size);
    if (next.id >= 0) {
      const TreeNode& parent = tree.nodes[next.id / width];
      const int slot = next.id % width;
      const std::int32_t child = parent.child[slot];
      if (child >= 0) {
        if (!hidden(parent, slot)) open(child);
        continue;
      }
      // a box with a lower bound of its key: continue with the exact key
      next = {query.key(tree.boxes + 6 * static_cast<std::int64_t>(-1 - child)), child};
      if (!(next.key <= limit2)) continue;
      if (size > 0 && before(heap[0], next)) {
        push(heap, size, next);
        continue;
      }
    }
    const std::int32_t index = -1 - next.id;
    const typename Query::Accepted hit =
        query.accept(tree.boxes + 6 * static_cast<std::int64_t>(index));
    bool duplicate = false;
    for (int i = 0; i < found; ++i)
      duplicate = duplicate || query.is_duplicate(accepted[i], hit, cone_cosine);
    if (duplicate) continue;
    accepted[found] = hit;
    out[found++] = {next.key, index};
  }
  return found;
}

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::scene::kernel

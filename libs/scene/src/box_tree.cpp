#include "box_tree.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <span>
#include <utility>

#include "hamelin/core/numbers.hpp"

namespace hamelin::scene::box_tree {

namespace {

// A box with its original index, sorted by the builder.
struct Item {
  Box box;
  std::int32_t index;
};

struct Bounds {
  Eigen::Vector3d lo = Eigen::Vector3d::Constant(infinity);
  Eigen::Vector3d hi = Eigen::Vector3d::Constant(-infinity);

  template <class B>
  void add(const B& box) {
    lo = lo.cwiseMin(box.lo);
    hi = hi.cwiseMax(box.hi);
  }
  [[nodiscard]] double half_area() const {
    const Eigen::Vector3d e = hi - lo;
    return e[0] * e[1] + e[1] * e[2] + e[2] * e[0];
  }
};

struct Group {
  std::span<Item> items;
  Bounds bounds;
  double cost = 0.0;  // the group of largest cost is split first

  explicit Group(std::span<Item> of = {}) : items(of) {
    for (const Item& item : items) bounds.add(item.box);
    cost = items.size() < 2 ? -1.0 : bounds.half_area() * static_cast<double>(items.size());
  }
};

double twice_center(const Item& item, int axis) {
  return item.box.lo[axis] + item.box.hi[axis];
}

// Splits a group in two and sorts the items accordingly; in the middle of their order if the
// heuristic finds no split, or if `halve` is set. @return the size of the first part
std::size_t split(std::span<Item> items, bool halve) {
  constexpr std::size_t bins = 16;
  double best_cost = infinity, best_cut = 0.0;
  int best_axis = -1;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(infinity), high = -low;
  for (const Item& item : items) {
    const Eigen::Vector3d center = item.box.lo + item.box.hi;
    low = low.cwiseMin(center);
    high = high.cwiseMax(center);
  }
  const Eigen::Vector3d spread = high - low;
  for (int axis = 0; axis < 3 && !halve; ++axis) {
    if (!(spread[axis] > 0.0)) continue;
    std::array<std::size_t, bins> count{};
    std::array<Bounds, bins> bounds;
    const double scale = double{bins} / spread[axis];
    for (const Item& item : items) {
      const auto bin = std::min(
          bins - 1, static_cast<std::size_t>((twice_center(item, axis) - low[axis]) * scale));
      bounds[bin].add(item.box);
      ++count[bin];
    }
    // costs of the boxes to the left of each cut, then of those to the right
    std::array<double, bins> cost{};
    const auto sweep = [&](auto cut_after, std::size_t from, std::size_t step) {
      Bounds all;
      std::size_t n = 0;
      for (std::size_t i = 0, bin = from; i + 1 < bins; ++i, bin += step) {
        if (count[bin] > 0) all.add(bounds[bin]);
        n += count[bin];
        cost[cut_after(bin)] += n == 0 ? infinity : static_cast<double>(n) * all.half_area();
      }
    };
    sweep([](std::size_t bin) { return bin + 1; }, 0, 1);
    sweep([](std::size_t bin) { return bin; }, bins - 1, static_cast<std::size_t>(-1));
    for (std::size_t cut = 1; cut < bins; ++cut) {
      if (!(cost[cut] < best_cost)) continue;
      best_cost = cost[cut];
      best_axis = axis;
      best_cut = low[axis] + spread[axis] * static_cast<double>(cut) / double{bins};
    }
  }
  if (best_axis >= 0) {
    const auto middle = std::partition(items.begin(), items.end(), [&](const Item& item) {
      return twice_center(item, best_axis) < best_cut;
    });
    if (middle != items.begin() && middle != items.end())
      return static_cast<std::size_t>(middle - items.begin());
  }
  int axis = 0;
  spread.maxCoeff(&axis);
  const auto middle = items.begin() + static_cast<std::ptrdiff_t>(items.size() / 2);
  std::nth_element(items.begin(), middle, items.end(), [&](const Item& a, const Item& b) {
    const double x = twice_center(a, axis), y = twice_center(b, axis);
    return x != y ? x < y : a.index < b.index;
  });
  return items.size() / 2;
}

// Appends the node of these items and all nodes below it. @return its index
std::int32_t build(std::span<Item> items, int depth, const Eigen::Vector3d& origin,
                   std::vector<kernel::TreeNode>& nodes) {
  // Splits in the middle below this depth keep the traversal's stack within its fixed size.
  constexpr int heuristic_depth = 10;
  std::array<Group, width> groups;
  std::size_t count = 1;
  if (items.size() <= width) {
    count = items.size();
    for (std::size_t i = 0; i < count; ++i) groups[i] = Group(items.subspan(i, 1));
  } else {
    groups[0] = Group(items);
  }
  while (count < width) {
    auto* const costliest =
        std::max_element(groups.begin(), groups.begin() + static_cast<std::ptrdiff_t>(count),
                         [](const Group& a, const Group& b) { return a.cost < b.cost; });
    if (costliest->cost < 0.0) break;
    const std::span<Item> group = costliest->items;
    const std::size_t cut = split(group, depth >= heuristic_depth);
    *costliest = Group(group.first(cut));
    groups[count++] = Group(group.subspan(cut));
  }
  const std::size_t self = nodes.size();
  nodes.emplace_back();
  kernel::TreeNode node{};
  node.count = static_cast<std::int32_t>(count);
  for (std::size_t slot = 0; slot < width; ++slot) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<Eigen::Index>(axis);
      node.lo[axis][slot] =
          slot < count ? round_down(groups[slot].bounds.lo[a] - origin[a]) : float_infinity;
      node.hi[axis][slot] =
          slot < count ? round_up(groups[slot].bounds.hi[a] - origin[a]) : float_infinity;
    }
    if (slot >= count) continue;
    node.child[slot] = groups[slot].items.size() == 1
                           ? -1 - groups[slot].items.front().index
                           : build(groups[slot].items, depth + 1, origin, nodes);
  }
  nodes[self] = node;
  return static_cast<std::int32_t>(self);
}

}  // namespace

void append(std::vector<Box>& boxes, std::size_t first, const Eigen::Vector3d& origin,
            std::vector<kernel::TreeNode>& nodes, std::vector<std::int32_t>& slot_of) {
  std::vector<Item> items(boxes.size());
  for (std::size_t i = 0; i < items.size(); ++i)
    items[i] = {boxes[i], static_cast<std::int32_t>(i)};
  const std::size_t root = nodes.size();
  nodes.reserve(root + boxes.size() / 3 + 1);
  build(items, 0, origin, nodes);
  std::vector<Box> ordered;
  ordered.reserve(boxes.size());
  slot_of.resize(first);
  for (std::size_t n = root; n < nodes.size(); ++n)
    for (std::int32_t slot = 0; slot < nodes[n].count; ++slot) {
      std::int32_t& child = nodes[n].child[slot];
      if (child >= 0) continue;
      ordered.push_back(boxes[static_cast<std::size_t>(-1 - child)]);
      child = -static_cast<std::int32_t>(first + ordered.size());
      slot_of.push_back(static_cast<std::int32_t>(n * width) + slot);
    }
  boxes = std::move(ordered);
}

kernel::TreeNode empty_root() {
  kernel::TreeNode root{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::fill(std::begin(root.lo[axis]), std::end(root.lo[axis]), float_infinity);
    std::fill(std::begin(root.hi[axis]), std::end(root.hi[axis]), float_infinity);
  }
  return root;
}

void attach(kernel::TreeNode& root, const kernel::TreeNode& node, std::size_t index) {
  const auto slot = static_cast<std::size_t>(root.count++);
  root.child[slot] = static_cast<std::int32_t>(index);
  const auto count = static_cast<std::size_t>(node.count);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    root.lo[axis][slot] = *std::min_element(node.lo[axis], node.lo[axis] + count);
    float high = -float_infinity;
    for (std::size_t i = 0; i < count; ++i)
      if (node.lo[axis][i] < float_infinity) high = std::max(high, node.hi[axis][i]);
    root.hi[axis][slot] = root.lo[axis][slot] < float_infinity ? high : float_infinity;
  }
}

}  // namespace hamelin::scene::box_tree

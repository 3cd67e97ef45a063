#include "hamelin/scene/distance.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

namespace hamelin::scene {

namespace {

constexpr float float_infinity = std::numeric_limits<float>::infinity();

float round_down(double x) {
  const auto f = static_cast<float>(x);
  return static_cast<double>(f) > x ? std::nextafter(f, -float_infinity) : f;
}

float round_up(double x) {
  const auto f = static_cast<float>(x);
  return static_cast<double>(f) < x ? std::nextafter(f, float_infinity) : f;
}

// Four floats that go through the machine together; GCC and clang lower this to whatever there is. Element by element
// it is plain arithmetic, so results do not depend on the machine.
using Four [[gnu::vector_size(16)]] = float;

inline Four splat(float x) {
  return Four{x, x, x, x};
}
inline Four max(Four a, Four b) {
  return a > b ? a : b;
}
inline Four load(const float* from) {
  Four x;
  std::memcpy(&x, from, sizeof x);
  return x;
}

double squared_distance(const Eigen::Vector3d& p, const Box& box) {
  double sum = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    const double below = box.lo[axis] - p[axis], above = p[axis] - box.hi[axis];
    const double out = below > above ? below : above;
    sum += out > 0.0 ? out * out : 0.0;
  }
  return sum;
}

double depth_inside(const Eigen::Vector3d& p, const Box& box) {
  return (p - box.lo).cwiseMin(box.hi - p).minCoeff();
}

// Squared distance, or minus the squared depth inside: one number that orders boxes by signed distance.
double signed_square(const Eigen::Vector3d& p, const Box& box) {
  const double d2 = squared_distance(p, box);
  if (d2 > 0.0) return d2;
  const double depth = depth_inside(p, box);
  return -depth * depth;
}

Box bounds_of(const std::vector<Box>& boxes, std::span<const std::int32_t> items) {
  Box bounds = boxes[static_cast<std::size_t>(items.front())];
  for (const std::int32_t item : items) {
    const Box& box = boxes[static_cast<std::size_t>(item)];
    bounds.lo = bounds.lo.cwiseMin(box.lo);
    bounds.hi = bounds.hi.cwiseMax(box.hi);
  }
  return bounds;
}

double half_area(const Box& box) {
  const Eigen::Vector3d e = box.hi - box.lo;
  return e[0] * e[1] + e[1] * e[2] + e[2] * e[0];
}

// Where to cut a group in two: by the surface area heuristic over 16 bins of the box centres on each axis, or in the
// middle of their order where that finds nothing (or the tree grows too deep). Sorts the items accordingly.
std::size_t split(const std::vector<Box>& boxes, std::span<std::int32_t> items, bool halve) {
  constexpr std::size_t bins = 16;
  const auto center = [&](std::int32_t item, int axis) {
    const Box& box = boxes[static_cast<std::size_t>(item)];
    return box.lo[axis] + box.hi[axis];
  };
  double best_cost = std::numeric_limits<double>::infinity();
  int best_axis = -1;
  double best_cut = 0.0;
  Eigen::Vector3d spread;
  for (int axis = 0; axis < 3; ++axis) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const std::int32_t item : items) {
      low = std::min(low, center(item, axis));
      high = std::max(high, center(item, axis));
    }
    spread[axis] = high - low;
    if (halve || !(spread[axis] > 0.0)) continue;
    std::array<std::size_t, bins> count{};
    std::array<Box, bins> bounds{};
    const auto bin_of = [&](std::int32_t item) {
      return std::min(bins - 1, static_cast<std::size_t>((center(item, axis) - low) / (high - low) * double{bins}));
    };
    for (const std::int32_t item : items) {
      const std::size_t bin = bin_of(item);
      const Box& box = boxes[static_cast<std::size_t>(item)];
      bounds[bin] = count[bin] == 0 ? box : Box{bounds[bin].lo.cwiseMin(box.lo), bounds[bin].hi.cwiseMax(box.hi)};
      ++count[bin];
    }
    const auto sweep_cost = [&](std::size_t begin, std::size_t end) {
      Box all;
      std::size_t n = 0;
      for (std::size_t bin = begin; bin < end; ++bin) {
        if (count[bin] == 0) continue;
        all = n == 0 ? bounds[bin] : Box{all.lo.cwiseMin(bounds[bin].lo), all.hi.cwiseMax(bounds[bin].hi)};
        n += count[bin];
      }
      return n == 0 ? std::numeric_limits<double>::infinity() : static_cast<double>(n) * half_area(all);
    };
    for (std::size_t cut = 1; cut < bins; ++cut) {
      const double cost = sweep_cost(0, cut) + sweep_cost(cut, bins);
      if (cost < best_cost) {
        best_cost = cost;
        best_axis = axis;
        best_cut = low + (high - low) * static_cast<double>(cut) / double{bins};
      }
    }
  }
  if (best_axis >= 0) {
    const auto middle = std::stable_partition(items.begin(), items.end(),
                                              [&](std::int32_t item) { return center(item, best_axis) < best_cut; });
    if (middle != items.begin() && middle != items.end()) return static_cast<std::size_t>(middle - items.begin());
  }
  int axis = 0;
  spread.maxCoeff(&axis);
  std::stable_sort(items.begin(), items.end(),
                   [&](std::int32_t a, std::int32_t b) { return center(a, axis) < center(b, axis); });
  return items.size() / 2;
}

}  // namespace

BoxHit closest_on_box(const Eigen::Vector3d& p, const Box& box) {
  BoxHit hit;
  hit.point = p.cwiseMax(box.lo).cwiseMin(box.hi);
  const Eigen::Vector3d out = p - hit.point;
  const double d2 = out.squaredNorm();
  // Below 1e-150 the square has lost its digits; such a point lies on the surface.
  if (d2 > 1e-300) {
    hit.distance = std::sqrt(d2);
    hit.direction = out / hit.distance;
    return hit;
  }
  int axis = 0;
  const double below = (p - box.lo).minCoeff(&axis);
  int axis_above = 0;
  const double above = (box.hi - p).minCoeff(&axis_above);
  const bool up = above < below;
  if (up) axis = axis_above;
  hit.distance = -std::max(0.0, std::min(below, above));
  hit.direction[axis] = up ? 1.0 : -1.0;
  hit.point[axis] = up ? box.hi[axis] : box.lo[axis];
  return hit;
}

// The query point as the nodes need it: in single precision, with a slack for its own rounding on either side.
struct BoxField::Query {
  std::array<float, 3> low, high;
  float bound = 0.0F;

  Query(const Eigen::Vector3d& p, const Eigen::Vector3d& origin) {
    for (int axis = 0; axis < 3; ++axis) {
      low[static_cast<std::size_t>(axis)] = round_down(p[axis] - origin[axis]);
      high[static_cast<std::size_t>(axis)] = round_up(p[axis] - origin[axis]);
    }
  }

  // Three subtractions, squares and sums in single precision are off by less than 8 units in the last place.
  void limit_to(double squared) { bound = round_up(squared * (1.0 + 1e-6)); }

  void squared_distances(const Node& node, Lanes& out) const {
    for (std::size_t half = 0; half < width; half += 4) {
      Four sum = splat(0.0F);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const Four below = load(&node.lo[axis][half]) - splat(high[axis]);
        const Four above = splat(low[axis]) - load(&node.hi[axis][half]);
        const Four outside = max(max(below, above), splat(0.0F));
        sum += outside * outside;
      }
      std::memcpy(&out[half], &sum, sizeof sum);
    }
  }
};

BoxField::BoxField(std::vector<Box> boxes, const Eigen::Vector3d& origin) : boxes_(std::move(boxes)), origin_(origin) {
  if (boxes_.empty()) return;
  std::vector<std::int32_t> items(boxes_.size());
  std::iota(items.begin(), items.end(), 0);
  build(items, 0);
  // Leaves in the order of the tree: what is near in space is near in memory.
  std::vector<Box> ordered;
  ordered.reserve(boxes_.size());
  for (Node& node : nodes_) {
    for (std::size_t slot = 0; slot < static_cast<std::size_t>(node.count); ++slot) {
      if (node.child[slot] >= 0) continue;
      ordered.push_back(boxes_[static_cast<std::size_t>(-1 - node.child[slot])]);
      node.child[slot] = -static_cast<std::int32_t>(ordered.size());
    }
  }
  boxes_ = std::move(ordered);
}

std::int32_t BoxField::build(std::span<std::int32_t> items, int depth) {
  // Cutting in the middle below this depth keeps the traversal's stack within its fixed size.
  constexpr int depth_of_free_cuts = 10;
  std::array<std::span<std::int32_t>, width> groups;
  std::size_t count = 1;
  groups[0] = items;
  while (count < width) {
    std::size_t widest = width;
    double widest_area = -1.0;
    for (std::size_t i = 0; i < count; ++i) {
      if (groups[i].size() < 2) continue;
      const double area = half_area(bounds_of(boxes_, groups[i])) * static_cast<double>(groups[i].size());
      if (area > widest_area) {
        widest_area = area;
        widest = i;
      }
    }
    if (widest == width) break;
    const std::span<std::int32_t> group = groups[widest];
    const std::size_t cut = split(boxes_, group, depth >= depth_of_free_cuts);
    groups[widest] = group.first(cut);
    groups[count++] = group.subspan(cut);
  }
  const auto self = static_cast<std::int32_t>(nodes_.size());
  nodes_.emplace_back();
  Node node;
  node.count = static_cast<std::int32_t>(count);
  for (std::size_t slot = 0; slot < width; ++slot) {
    node.child[slot] = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) node.lo[axis][slot] = node.hi[axis][slot] = float_infinity;
    if (slot >= count) continue;
    const Box bounds = bounds_of(boxes_, groups[slot]);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<Eigen::Index>(axis);
      node.lo[axis][slot] = round_down(bounds.lo[a] - origin_[a]);
      node.hi[axis][slot] = round_up(bounds.hi[a] - origin_[a]);
    }
    node.child[slot] = groups[slot].size() == 1 ? -1 - groups[slot].front() : build(groups[slot], depth + 1);
  }
  nodes_[static_cast<std::size_t>(self)] = node;
  return self;
}

bool BoxField::nearest(const Eigen::Vector3d& p, double limit, BoxHit& hit, std::int32_t hint) const {
  if (nodes_.empty() || !(limit >= 0.0)) return false;
  double best = limit * limit;
  std::int32_t best_box = -1;
  const auto try_box = [&](std::int32_t index) {
    const double key = signed_square(p, boxes_[static_cast<std::size_t>(index)]);
    if (key < best || (key == best && (best_box < 0 || index < best_box))) {
      best = key;
      best_box = index;
      return true;
    }
    return false;
  };
  Query query(p, origin_);
  if (hint >= 0 && static_cast<std::size_t>(hint) < boxes_.size()) try_box(hint);
  query.limit_to(std::max(best, 0.0));

  struct Entry {
    float bound;
    std::int32_t node;
  };
  // At most 10 levels of free cuts and 31 of halving, each leaving at most 7 siblings behind.
  std::array<Entry, 512> stack;
  std::size_t waiting = 0;
  stack[waiting++] = {0.0F, 0};
  Lanes squares;
  while (waiting > 0) {
    const Entry entry = stack[--waiting];
    if (entry.bound > query.bound) continue;
    const Node& node = nodes_[static_cast<std::size_t>(entry.node)];
    query.squared_distances(node, squares);
    const std::size_t first = waiting;
    for (std::size_t slot = 0; slot < static_cast<std::size_t>(node.count); ++slot) {
      const float bound = squares[slot];
      if (bound > query.bound) continue;
      const std::int32_t child = node.child[slot];
      if (child < 0) {
        if (try_box(-1 - child)) query.limit_to(std::max(best, 0.0));
        continue;
      }
      // Nearest on top of the stack.
      std::size_t at = waiting++;
      for (; at > first && stack[at - 1].bound < bound; --at) stack[at] = stack[at - 1];
      stack[at] = {bound, child};
    }
  }
  if (best_box < 0) return false;
  hit = closest_on_box(p, boxes_[static_cast<std::size_t>(best_box)]);
  hit.box = best_box;
  return true;
}

std::size_t BoxField::several(const Eigen::Vector3d& p, double limit, double cone_cosine, Scratch& scratch,
                              std::span<BoxHit> out) const {
  if (nodes_.empty() || out.empty() || !(limit >= 0.0)) return 0;
  using Entry = Scratch::Entry;
  // A short list, the smallest key last; nodes before boxes of the same key, so that equals come in order of index.
  // What is found next is mostly near, so it finds its place in a few steps from the end.
  const auto later = [](const Entry& a, const Entry& b) { return a.key != b.key ? a.key > b.key : a.index > b.index; };
  auto& waiting = scratch.waiting_;
  waiting.clear();
  const auto put = [&](const Entry& entry) {
    waiting.push_back(entry);
    std::size_t at = waiting.size() - 1;
    for (; at > 0 && later(entry, waiting[at - 1]); --at) waiting[at] = waiting[at - 1];
    waiting[at] = entry;
  };
  Query query(p, origin_);
  query.limit_to(limit * limit);
  std::size_t found = 0;
  // A direction counts as seen by a hair more than the cone asks, so that what is left out early would be later as
  // well.
  const double seen_square = cone_cosine * cone_cosine * (1.0 + 1e-9);
  const bool narrow = cone_cosine > 0.0;
  const auto in_cone = [&](double along, double square) { return along > 0.0 && along * along > seen_square * square; };
  // Whether the box's nearest point is seen already.
  const auto seen_box = [&](const Box& box) {
    const Eigen::Vector3d away = p - p.cwiseMax(box.lo).cwiseMin(box.hi);
    const double square = away.squaredNorm();
    for (std::size_t kept = 0; kept < found; ++kept)
      if (in_cone(out[kept].direction.dot(away), square)) return true;
    return false;
  };
  // Whether all of a node's slot is: a cone is convex, so its corners decide.
  const Eigen::Vector3d from_origin = p - origin_;
  const auto seen_slot = [&](const Node& node, std::size_t slot) {
    std::array<std::array<double, 2>, 3> away, square;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double at = from_origin[static_cast<Eigen::Index>(axis)];
      away[axis] = {at - static_cast<double>(node.lo[axis][slot]), at - static_cast<double>(node.hi[axis][slot])};
      square[axis] = {away[axis][0] * away[axis][0], away[axis][1] * away[axis][1]};
    }
    const auto all_in = [&](std::size_t kept) {
      const Eigen::Vector3d& d = out[kept].direction;
      for (std::size_t corner = 0; corner < 8; ++corner) {
        const std::size_t i = corner & 1U, j = corner >> 1U & 1U, k = corner >> 2U;
        if (!in_cone(d.x() * away[0][i] + d.y() * away[1][j] + d.z() * away[2][k],
                     square[0][i] + square[1][j] + square[2][k]))
          return false;
      }
      return true;
    };
    for (std::size_t kept = 0; kept < found; ++kept)
      if (all_in(kept)) return true;
    return false;
  };
  Lanes squares;
  put({-std::numeric_limits<double>::infinity(), -1});
  while (!waiting.empty()) {
    const Entry entry = waiting.back();
    waiting.pop_back();
    if (entry.index >= 0) {
      BoxHit hit = closest_on_box(p, boxes_[static_cast<std::size_t>(entry.index)]);
      hit.box = entry.index;
      const bool seen =
          std::any_of(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(found),
                      [&](const BoxHit& kept) { return kept.direction.dot(hit.direction) > cone_cosine; });
      if (seen) continue;
      out[found++] = hit;
      if (found == out.size()) break;
      continue;
    }
    const Node& node = nodes_[static_cast<std::size_t>(-1 - entry.index)];
    query.squared_distances(node, squares);
    for (std::size_t slot = 0; slot < static_cast<std::size_t>(node.count); ++slot) {
      if (squares[slot] > query.bound) continue;
      const std::int32_t child = node.child[slot];
      if (child < 0) {
        const std::int32_t box = -1 - child;
        const double key = signed_square(p, boxes_[static_cast<std::size_t>(box)]);
        if (key > limit * limit || (narrow && key > 0.0 && seen_box(boxes_[static_cast<std::size_t>(box)]))) continue;
        put({key, box});
      } else {
        if (narrow && squares[slot] > 0.0F && seen_slot(node, slot)) continue;
        // A hair below the computed bound, which may itself have been rounded up.
        put({static_cast<double>(squares[slot]) * (1.0 - 1e-6), -1 - child});
      }
    }
  }
  return found;
}

FarTable::FarTable(const BoxField& field, const Ball& region, double edge, double exact_up_to) {
  constexpr std::size_t block = 4;          // cells along a block's edge
  constexpr std::size_t cells_max = 100;    // along an axis, a multiple of it
  constexpr double hair = 1e-6;             // far above the rounding of points, cells and floats [m]
  constexpr double cell_reach = 0.8660255;  // half a cube's diagonal over its edge
  if (field.empty() || !(region.radius > 0.0)) return;
  const auto blocks = static_cast<std::size_t>(
      std::ceil(std::min(2.0 * region.radius / edge, static_cast<double>(cells_max)) / double{block}));
  cells_ = block * blocks;
  edge_ = std::max(edge, 2.0 * region.radius / static_cast<double>(cells_));
  per_edge_ = 1.0 / edge_;
  low_ = region.center - Eigen::Vector3d::Constant(0.5 * edge_ * static_cast<double>(cells_));
  bounds_.assign(cells_ * cells_ * cells_, -float_infinity);
  const auto middle = [&](const std::array<std::size_t, 3>& cell, double half) {
    return Eigen::Vector3d(low_ + edge_ * Eigen::Vector3d(static_cast<double>(cell[0]) + half,
                                                          static_cast<double>(cell[1]) + half,
                                                          static_cast<double>(cell[2]) + half));
  };
  BoxHit hit;
  std::int32_t hint = -1;
  const auto distance = [&](const Eigen::Vector3d& p) {
    (void)field.nearest(p, std::numeric_limits<double>::infinity(), hit, hint);
    hint = hit.box;
    return hit.distance;
  };
  const double block_reach = cell_reach * static_cast<double>(block) * edge_;
  std::array<std::size_t, 3> first{}, cell{};
  for (first[0] = 0; first[0] < cells_; first[0] += block)
    for (first[1] = 0; first[1] < cells_; first[1] += block)
      for (first[2] = 0; first[2] < cells_; first[2] += block) {
        const Eigen::Vector3d center = middle(first, 0.5 * double{block});
        if ((center - region.center).norm() > region.radius + block_reach) continue;
        const double around = distance(center);
        const bool coarse = around - block_reach > exact_up_to;
        // deep inside: nothing is beyond any limit there
        if (around < -block_reach) continue;
        for (cell[0] = first[0]; cell[0] < first[0] + block; ++cell[0])
          for (cell[1] = first[1]; cell[1] < first[1] + block; ++cell[1])
            for (cell[2] = first[2]; cell[2] < first[2] + block; ++cell[2]) {
              const Eigen::Vector3d at = middle(cell, 0.5);
              const double bound = coarse ? around - (at - center).norm() : distance(at);
              bounds_[(cell[0] * cells_ + cell[1]) * cells_ + cell[2]] = round_down(bound - hair);
            }
      }
}

}  // namespace hamelin::scene

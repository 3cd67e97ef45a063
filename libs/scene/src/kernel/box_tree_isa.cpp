// Compiled once for each instruction set; see dynamics/kernel/lanes.hpp on what may be used here.
// Unlike other kernels, this one is compiled without fused multiply-add: all instruction sets give
// the same bits.
#include "hamelin/scene/kernel/box_tree.hpp"
#include "segment_box.hpp"

namespace hamelin::scene::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

namespace {

#if defined(__AVX2__)
constexpr int lanes = 8;
#else
constexpr int lanes = 4;
#endif
using Lanes [[gnu::vector_size(4 * lanes)]] = float;
constexpr int width = TreeNode::width;

HAMELIN_INLINE Lanes splat(float x) {
  return x - Lanes{};
}
HAMELIN_INLINE Lanes max(Lanes a, Lanes b) {
  return a > b ? a : b;
}
HAMELIN_INLINE Lanes min(Lanes a, Lanes b) {
  return a < b ? a : b;
}
HAMELIN_INLINE Lanes load(const float* from) {
  Lanes x;
  __builtin_memcpy(&x, from, sizeof x);
  return x;
}
HAMELIN_INLINE void store(Lanes x, float* to) {
  __builtin_memcpy(to, &x, sizeof x);
}
HAMELIN_INLINE float magnitude(float x) {
  return x < 0.0F ? -x : x;
}
HAMELIN_INLINE constexpr float infinity() {
  return __builtin_inff();
}

// A bit mask of those of a node's eight numbers that are not above the bound.
HAMELIN_INLINE unsigned not_above(const float* x, float bound) {
  unsigned bits = 0;
#if defined(__AVX2__)
  bits = static_cast<unsigned>(__builtin_ia32_movmskps256(load(x) <= splat(bound)));
#elif defined(__SSE2__)
  for (int half = 0; half < width; half += lanes)
    bits |= static_cast<unsigned>(__builtin_ia32_movmskps(load(x + half) <= splat(bound))) << half;
#else
  for (int i = 0; i < width; ++i) bits |= (x[i] <= bound ? 1U : 0U) << i;
#endif
  return bits;
}

constexpr float float_max = 3.4e38F;

// The value with which lower bounds in single precision are compared: a squared distance widened
// for their rounding, docs/theory.md (11.17).
HAMELIN_INLINE float bound_of(double squared) {
  const double wide = (squared > 0.0 ? squared : 0.0) * (1.0 + 2e-6);
  return wide < 3.3e38 ? static_cast<float>(wide) + 1e-37F : float_max;
}

// A point's offset from a box and its key, docs/theory.md (11.1)–(11.3).
struct Offset {
  double x[3];
  double key;  ///< squared distance (11.2); inside the box: minus the squared depth (11.3)
  int face;    ///< inside: the nearest face, lower ones before upper ones; else −1
};

HAMELIN_INLINE Offset offset_from(const double* p, const double* box) {
  Offset offset{};
  offset.face = -1;
  for (int i = 0; i < 3; ++i) {
    offset.x[i] = outside(p[i], box[i], box[3 + i]);
    offset.key += offset.x[i] * offset.x[i];
  }
  if (offset.key > 0.0) return offset;
  double depth = p[0] - box[0];
  offset.face = 0;
  for (int i = 1; i < 6; ++i) {
    const double d = i < 3 ? p[i] - box[i] : box[i] - p[i - 3];
    if (d < depth) {
      depth = d;
      offset.face = i;
    }
  }
  offset.key = -depth * depth;
  return offset;
}

// A query point: bounds for nodes, keys and directions for boxes.
class Point {
 public:
  // What decides whether another box is a duplicate of this one.
  struct Accepted {
    double direction[3];
    float direction_f[3];
  };

  HAMELIN_INLINE Point(const Tree& tree, const double* p) noexcept : p_(p) {
    for (int i = 0; i < 3; ++i) {
      const float at = static_cast<float>(p[i] - tree.origin[i]);
      const float slack = magnitude(at) * 1.2e-7F + 1e-37F;  // docs/theory.md (11.15)
      low_[i] = at - slack;
      high_[i] = at + slack;
      at_[i] = at;
      slack_ += magnitude(at) * 1e-6F;
    }
  }

  // Lower bounds of the squared distances of a node's children, docs/theory.md (11.16).
  HAMELIN_INLINE void bounds(const TreeNode& node, float* out) const {
    for (int half = 0; half < width; half += lanes) {
      Lanes sum{};
      for (int i = 0; i < 3; ++i) {
        const Lanes below = load(node.lo[i] + half) - splat(high_[i]);
        const Lanes above = splat(low_[i]) - load(node.hi[i] + half);
        const Lanes out_by = max(max(below, above), Lanes{});
        sum += out_by * out_by;
      }
      store(sum, out + half);
    }
  }

  // Sets to infinity the bounds of those boxes of a node that are certainly duplicates of an
  // accepted one and no farther than `limit`, docs/theory.md (11.39).
  HAMELIN_INLINE void drop_duplicates(const TreeNode& node, const Accepted& accepted, float cosine,
                                      float limit, float* bounds) const {
    const float error = slack_ + 4e-6F * limit;
    const Lanes least = splat(cosine * cosine * 1.00001F);
    for (int half = 0; half < width; half += lanes) {
      Lanes along{}, square = splat(error * (2.0F * limit + error));
      for (int i = 0; i < 3; ++i) {
        const Lanes above = max(splat(at_[i]) - load(node.hi[i] + half), Lanes{});
        const Lanes below = max(load(node.lo[i] + half) - splat(at_[i]), Lanes{});
        const Lanes offset = above - below;
        along += offset * splat(accepted.direction_f[i]);
        square += offset * offset;
      }
      along = max(along - splat(error), Lanes{});
      const auto duplicate = along * along > least * square;
      store(duplicate ? splat(infinity()) : load(bounds + half), bounds + half);
    }
  }

  HAMELIN_INLINE double key(const double* box) const { return offset_from(p_, box).key; }

  HAMELIN_INLINE Accepted accept(const double* box) const {
    const Offset offset = offset_from(p_, box);
    Accepted accepted{};
    const double length = __builtin_sqrt(offset.key > 0.0 ? offset.key : 1.0);
    for (int i = 0; i < 3; ++i)
      accepted.direction[i] = offset.face < 0 ? offset.x[i] / length : 0.0;
    if (offset.face >= 0) accepted.direction[offset.face % 3] = offset.face < 3 ? -1.0 : 1.0;
    for (int i = 0; i < 3; ++i) accepted.direction_f[i] = static_cast<float>(accepted.direction[i]);
    return accepted;
  }
  // docs/theory.md (11.22)
  HAMELIN_INLINE bool is_duplicate(const Accepted& accepted, const Accepted& other,
                                   double cone_cosine) const {
    double dot = 0.0;
    for (int i = 0; i < 3; ++i) dot += accepted.direction[i] * other.direction[i];
    return dot > cone_cosine;
  }

  // Whether everything in a child lies in the cone of an accepted box, docs/theory.md (11.23), with
  // a margin for rounding.
  HAMELIN_INLINE bool hidden(const TreeNode& node, int slot, const Accepted& accepted, float cosine,
                             float sine) const {
    float along = 0.0F, square = 0.0F, radius2 = 0.0F;
    for (int i = 0; i < 3; ++i) {
      const float half = 0.5F * (node.hi[i][slot] - node.lo[i][slot]);
      const float offset = at_[i] - (node.lo[i][slot] + half);
      along += offset * accepted.direction_f[i];
      square += offset * offset;
      radius2 += half * half;
    }
    if (!(radius2 < 0.999F * sine * sine * square) || !(along > slack_)) return false;
    return along - slack_ >
           (cosine * __builtin_sqrtf(square - radius2) + sine * __builtin_sqrtf(radius2)) *
               1.00001F;
  }

 private:
  const double* p_;
  float low_[3], high_[3], at_[3];
  float slack_ = 0.0F;  // margin for rounding in single precision, far above the largest error
};

// A capsule's axis as a query.
class Segment {
 public:
  HAMELIN_INLINE Segment(const Tree& tree, const double* p, const double* q) noexcept
      : axis_(axis_of(p, q)) {
    float length2 = 0.0F;
    for (int i = 0; i < 3; ++i) {
      a_[i] = static_cast<float>(p[i] - tree.origin[i]);
      w_[i] = static_cast<float>(axis_.w[i]);
      slack_[i] = (magnitude(a_[i]) + magnitude(w_[i])) * 4e-7F + 1e-37F;  // docs/theory.md (11.18)
      length2 += w_[i] * w_[i];
      slack_sum_ += slack_[i];
    }
    // docs/theory.md (11.21)
    loss_ = 4.0F * slack_sum_ * __builtin_sqrtf(length2) + 2e-6F * length2;
  }

  // The squared distance f(t) of the point at t is convex, so f(s) ≥ f(t) + f'(t)(s − t) for every
  // t: docs/theory.md (11.20). Three Newton steps, docs/theory.md (11.19), bring t near the
  // minimum. `loss_` bounds the rounding errors.
  HAMELIN_INLINE void bounds(const TreeNode& node, float* out) const {
    for (int half = 0; half < width; half += lanes) {
      Lanes t = splat(0.5F), f{}, g{};
      for (int step = 0;; ++step) {
        Lanes curvature = splat(1e-30F);
        f = Lanes{};
        g = Lanes{};
        for (int i = 0; i < 3; ++i) {
          const Lanes at = splat(a_[i]) + t * splat(w_[i]);
          const Lanes above = max(at - (load(node.hi[i] + half) + splat(slack_[i])), Lanes{});
          const Lanes below = max((load(node.lo[i] + half) - splat(slack_[i])) - at, Lanes{});
          const Lanes e = above - below;
          f += e * e;
          g += splat(w_[i]) * e;
          curvature += e != Lanes{} ? splat(w_[i] * w_[i]) : Lanes{};
        }
        if (step == 3) break;
        t = min(max(t - g / curvature, Lanes{}), splat(1.0F));
      }
      const Lanes decrease = min(min(-(g * t), g * (splat(1.0F) - t)), Lanes{});
      store(max(f * splat(1.0F - 4e-6F) + splat(2.0F) * decrease - splat(loss_), Lanes{}),
            out + half);
    }
  }

  HAMELIN_INLINE double key(const double* box) const {
    return squared_distance(axis_, box, box + 3, nearest_along(axis_, box, box + 3));
  }

  struct Accepted {
    double direction[3];
    double along;
  };
  HAMELIN_INLINE Accepted accept(const double* box) const {
    Accepted accepted{};
    accepted.along = nearest_along(axis_, box, box + 3);
    double square = 0.0;
    for (int i = 0; i < 3; ++i) {
      accepted.direction[i] = outside(axis_.a[i] + accepted.along * axis_.w[i], box[i], box[3 + i]);
      square += accepted.direction[i] * accepted.direction[i];
    }
    const double length = __builtin_sqrt(square);
    for (double& x : accepted.direction) x = length > 0.0 ? x / length : 0.0;
    return accepted;
  }
  // Boxes that are near distant points of the axis are distinct for all directions:
  // docs/theory.md (11.22).
  HAMELIN_INLINE bool is_duplicate(const Accepted& accepted, const Accepted& other,
                                   double cone_cosine) const {
    const double apart = accepted.along - other.along;
    double dot = 0.0;
    for (int i = 0; i < 3; ++i) dot += accepted.direction[i] * other.direction[i];
    return dot > cone_cosine && apart < 1.0 / 3.0 && apart > -1.0 / 3.0;
  }
  HAMELIN_INLINE bool hidden(const TreeNode&, int, const Accepted&, float, float) const {
    return false;
  }
  HAMELIN_INLINE void drop_duplicates(const TreeNode&, const Accepted&, float, float,
                                      float*) const {}

 private:
  Axis axis_;
  float a_[3], w_[3], slack_[3];
  float slack_sum_ = 0.0F, loss_ = 0.0F;
};

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

bool nearest(const Tree& tree, const double* p, const double* q, double limit,
             Found& found) noexcept {
  return q == nullptr ? nearest_of(tree, Point(tree, p), limit, found)
                      : nearest_of(tree, Segment(tree, p, q), limit, found);
}

int nearest_distinct(const Tree& tree, const double* p, const double* q, double limit,
                     double cone_cosine, QueueEntry* queue, Found* out, int count) noexcept {
  return q == nullptr
             ? nearest_distinct_of(tree, Point(tree, p), limit, cone_cosine, queue, out, count)
             : nearest_distinct_of(tree, Segment(tree, p, q), limit, cone_cosine, queue, out,
                                   count);
}

int gather(const Tree& tree, const double* p, const double* q, double limit, TreeNode* nodes,
           int nodes_max) noexcept {
  return q == nullptr ? gather_of(tree, Point(tree, p), limit, nodes, nodes_max)
                      : gather_of(tree, Segment(tree, p, q), limit, nodes, nodes_max);
}

int nearest_distinct_among(const Tree& tree, const TreeNode* nodes, int node_count, const double* p,
                           const double* q, double limit, double cone_cosine, float* bounds,
                           Found* out, int count) noexcept {
  return q == nullptr ? nearest_distinct_among_of(tree, nodes, node_count, Point(tree, p), limit,
                                                  cone_cosine, bounds, out, count)
                      : nearest_distinct_among_of(tree, nodes, node_count, Segment(tree, p, q),
                                                  limit, cone_cosine, bounds, out, count);
}

}  // namespace

extern const TreeKernels tree_kernels;
constexpr TreeKernels tree_kernels{nearest, nearest_distinct, gather, nearest_distinct_among};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::scene::kernel

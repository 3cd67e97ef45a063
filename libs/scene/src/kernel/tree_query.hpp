#pragma once
#include <cstdint>

#include "float_lanes.hpp"
#include "hamelin/scene/kernel/box_tree.hpp"
#include "segment_box.hpp"

/// What a box tree is asked for: a point, or the axis of a capsule. Both have bounds for nodes, and
/// keys and directions for boxes.
namespace hamelin::scene::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

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

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::scene::kernel

// Compiled once per instruction set; kernel/lanes.hpp explains which functions may be used here.
#include "frame_batch_kernel.hpp"
#include "hamelin/dynamics/kernel/lanes.hpp"

namespace hamelin::dynamics {
namespace HAMELIN_ISA_NAMESPACE {

namespace {

using Pack = kernel::Lanes<kernel::native_lanes>;
using Vec = geometry::Vec3<Pack>;
constexpr auto lanes = static_cast<std::size_t>(kernel::native_lanes);

struct Pose {
  Vec x, y, z, p;
};
// What a column of the Jacobian needs of a joint.
struct Axis {
  Vec axis, at;
};

HAMELIN_INLINE Vec same(const geometry::Vec3<double>& a) noexcept {
  return {Pack(a.x), Pack(a.y), Pack(a.z)};
}
HAMELIN_INLINE Vec moved(const Pose& g, const geometry::Vec3<double>& a) noexcept {
  return g.x * Pack(a.x) + g.y * Pack(a.y) + g.z * Pack(a.z);
}
HAMELIN_INLINE Vec in_frame(const Pose& g, const Vec& a) noexcept {
  return {dot(g.x, a), dot(g.y, a), dot(g.z, a)};
}

// docs/theory.md (1.16)
HAMELIN_INLINE Pose advance(const BatchLink& l, Pack q, const Pose& g) noexcept {
  Pack s, c;
  kernel::sincos(l.prismatic ? Pack(l.offset) : q * Pack(l.sign) + Pack(l.offset), s, c);
  Vec p = g.p + moved(g, l.p0);
  if (l.prismatic) p = p + moved(g, l.slide) * q;
  const Vec y = g.y * Pack(l.cos_alpha) + g.z * Pack(l.sin_alpha);
  return {g.x * c + y * s, y * c - g.x * s, g.z * Pack(l.cos_alpha) - g.y * Pack(l.sin_alpha), p};
}

// The numbers of a packet of states, in rows; the last packet may have fewer states than lanes.
class Rows {
 public:
  Rows(const FrameBatchCall& call, std::size_t first) noexcept
      : stride_(call.stride),
        first_(first),
        count_(call.states - first < lanes ? call.states - first : lanes) {}
  HAMELIN_INLINE Pack load(const double* rows, std::size_t row) const noexcept {
    const double* const from = rows + row * stride_ + first_;
    if (count_ == lanes) return Pack::load(from);
    Pack out;
    for (std::size_t lane = 0; lane < lanes; ++lane) out.v[lane] = from[lane < count_ ? lane : 0];
    return out;
  }
  HAMELIN_INLINE void store(double* rows, std::size_t row, Pack x) const noexcept {
    double* const to = rows + row * stride_ + first_;
    if (count_ == lanes)
      x.store(to);
    else
      for (std::size_t lane = 0; lane < count_; ++lane) to[lane] = x.v[lane];
  }
  HAMELIN_INLINE void store(double* rows, std::size_t row, const Vec& a) const noexcept {
    store(rows, row, a.x);
    store(rows, row + 1, a.y);
    store(rows, row + 2, a.z);
  }

 private:
  std::size_t stride_, first_, count_;
};

// docs/theory.md (2.20), (2.33)
HAMELIN_INLINE void store_jacobian(const FrameBatchCall& call, const Rows& rows, const Axis* axes,
                                   const Pose& pose) noexcept {
  const Vec zero = same({0.0, 0.0, 0.0}), point = call.about_origin ? zero : pose.p;
  for (std::size_t j = 0; j < call.moving; ++j) {
    Vec angular = zero, linear = axes[j].axis;
    if (!call.links[j].prismatic) {
      angular = axes[j].axis;
      linear = cross(angular, point - axes[j].at);
    }
    if (call.local) {
      if (!call.links[j].prismatic) angular = in_frame(pose, angular);
      linear = in_frame(pose, linear);
    }
    rows.store(call.jacobians, 6 * j, angular);
    rows.store(call.jacobians, 6 * j + 3, linear);
  }
  for (std::size_t row = 6 * call.moving; row < 6 * call.dof; ++row)
    rows.store(call.jacobians, row, Pack(0.0));
}

std::size_t bytes(std::size_t dof) noexcept {
  return dof * sizeof(Axis);
}

void evaluate(const FrameBatchCall& call) noexcept {
  Axis* const axes = static_cast<Axis*>(call.memory);
  for (std::size_t first = 0; first < call.states; first += lanes) {
    const Rows rows(call, first);
    Pose g{same(call.root.x), same(call.root.y), same(call.root.z), same(call.root.p)};
    for (std::size_t j = 0; j < call.moving; ++j) {
      const BatchLink& l = call.links[j];
      g = advance(l, rows.load(call.q, j), g);
      axes[j] = {l.along_x ? g.x : l.prismatic ? g.z : g.z * Pack(l.sign), g.p};
    }
    const BatchPose& in_link = call.frame;
    Pose pose{same(in_link.x), same(in_link.y), same(in_link.z), same(in_link.p)};
    if (call.moving > 0)
      pose = {moved(g, in_link.x), moved(g, in_link.y), moved(g, in_link.z),
              g.p + moved(g, in_link.p)};
    if (call.poses != nullptr) {
      rows.store(call.poses, 0, pose.x);
      rows.store(call.poses, 3, pose.y);
      rows.store(call.poses, 6, pose.z);
      rows.store(call.poses, 9, pose.p);
    }
    if (call.jacobians != nullptr) store_jacobian(call, rows, axes, pose);
  }
}

}  // namespace

extern const FrameBatchKernel frame_batch_set;
constexpr FrameBatchKernel frame_batch_set{bytes, evaluate};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::dynamics

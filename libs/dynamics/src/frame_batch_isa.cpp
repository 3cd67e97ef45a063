// Compiled once per instruction set; kernel/lanes.hpp explains which functions may be used here.
#include "batch_lanes.hpp"
#include "frame_batch_kernel.hpp"

namespace hamelin::dynamics {
namespace HAMELIN_ISA_NAMESPACE {

namespace {

// What a column of the Jacobian needs of a joint.
struct Axis {
  BatchVec axis, at;
};

HAMELIN_INLINE BatchVec in_frame(const LanePose& g, const BatchVec& a) noexcept {
  return {dot(g.x, a), dot(g.y, a), dot(g.z, a)};
}

// docs/theory.md (2.20), (2.33)
HAMELIN_INLINE void store_jacobian(const FrameBatchCall& call, const PacketRows& rows,
                                   const Axis* axes, const LanePose& pose) noexcept {
  const BatchVec zero = same_in_lanes(geometry::Vec3<double>{0.0, 0.0, 0.0}),
                 point = call.about_origin ? zero : pose.p;
  for (std::size_t j = 0; j < call.moving; ++j) {
    BatchVec angular = zero, linear = axes[j].axis;
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
    rows.store(call.jacobians, row, BatchPack(0.0));
}

std::size_t bytes(std::size_t dof) noexcept {
  return dof * sizeof(Axis);
}

void evaluate(const FrameBatchCall& call) noexcept {
  Axis* const axes = static_cast<Axis*>(call.memory);
  for (std::size_t first = 0; first < call.states; first += batch_lanes) {
    const PacketRows in(call.states, call.stride, first),
        out(call.states, call.result_stride, first);
    LanePose g = same_in_lanes(call.root);
    for (std::size_t j = 0; j < call.moving; ++j) {
      const BatchLink& l = call.links[j];
      g = advance(l, in.load(call.q, j), g);
      axes[j] = {axis_of(l, g), g.p};
    }
    const BatchPose& in_link = call.frame;
    LanePose pose = same_in_lanes(in_link);
    if (call.moving > 0)
      pose = {rotated(g, in_link.x), rotated(g, in_link.y), rotated(g, in_link.z),
              g.p + rotated(g, in_link.p)};
    if (call.poses != nullptr) {
      out.store(call.poses, 0, pose.x);
      out.store(call.poses, 3, pose.y);
      out.store(call.poses, 6, pose.z);
      out.store(call.poses, 9, pose.p);
    }
    if (call.jacobians != nullptr) store_jacobian(call, out, axes, pose);
  }
}

}  // namespace

extern const FrameBatchKernel frame_batch_set;
constexpr FrameBatchKernel frame_batch_set{bytes, evaluate};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::dynamics

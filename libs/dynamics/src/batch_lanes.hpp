#pragma once
// For sources that are compiled once per instruction set: packets of states, one state per lane.
#include "batch_links.hpp"
#include "hamelin/dynamics/kernel/lanes.hpp"

namespace hamelin::dynamics {
namespace HAMELIN_ISA_NAMESPACE {

using BatchPack = kernel::Lanes<kernel::native_lanes>;
using BatchVec = geometry::Vec3<BatchPack>;
inline constexpr auto batch_lanes = static_cast<std::size_t>(kernel::native_lanes);

/// A pose by the columns of its rotation, and a position.
struct LanePose {
  BatchVec x, y, z, p;
};

HAMELIN_INLINE BatchVec same_in_lanes(const geometry::Vec3<double>& a) noexcept {
  return {BatchPack(a.x), BatchPack(a.y), BatchPack(a.z)};
}
HAMELIN_INLINE LanePose same_in_lanes(const BatchPose& g) noexcept {
  return {same_in_lanes(g.x), same_in_lanes(g.y), same_in_lanes(g.z), same_in_lanes(g.p)};
}
HAMELIN_INLINE BatchVec rotated(const LanePose& g, const geometry::Vec3<double>& a) noexcept {
  return g.x * BatchPack(a.x) + g.y * BatchPack(a.y) + g.z * BatchPack(a.z);
}

/// The pose of a link's frame from that of its parent's, docs/theory.md (1.16).
HAMELIN_INLINE LanePose advance(const BatchLink& l, BatchPack q, const LanePose& g) noexcept {
  BatchPack s, c;
  kernel::sincos(l.prismatic ? BatchPack(l.offset) : q * BatchPack(l.sign) + BatchPack(l.offset), s,
                 c);
  BatchVec p = g.p + rotated(g, l.p0);
  if (l.prismatic) p = p + rotated(g, l.slide) * q;
  const BatchVec y = g.y * BatchPack(l.cos_alpha) + g.z * BatchPack(l.sin_alpha);
  return {g.x * c + y * s, y * c - g.x * s,
          g.z * BatchPack(l.cos_alpha) - g.y * BatchPack(l.sin_alpha), p};
}
/// The axis or direction of a joint from the pose of its link's frame.
HAMELIN_INLINE BatchVec axis_of(const BatchLink& l, const LanePose& g) noexcept {
  return l.along_x ? g.x : l.prismatic ? g.z : g.z * BatchPack(l.sign);
}

/// The numbers of a packet of states, in rows; the last packet of a call may have fewer states than
/// lanes. Unused lanes repeat the first state.
class PacketRows {
 public:
  HAMELIN_INLINE PacketRows(std::size_t states, std::size_t stride, std::size_t first) noexcept
      : stride_(stride),
        first_(first),
        count_(states - first < batch_lanes ? states - first : batch_lanes) {}
  HAMELIN_INLINE BatchPack load(const double* rows, std::size_t row) const noexcept {
    const double* const from = rows + row * stride_ + first_;
    if (count_ == batch_lanes) return BatchPack::load(from);
    BatchPack out;
    for (std::size_t lane = 0; lane < batch_lanes; ++lane)
      out.v[lane] = from[lane < count_ ? lane : 0];
    return out;
  }
  HAMELIN_INLINE void load(const double* rows, std::size_t count, BatchPack* out) const noexcept {
    for (std::size_t row = 0; row < count; ++row) out[row] = load(rows, row);
  }
  HAMELIN_INLINE void store(double* rows, std::size_t row, BatchPack x) const noexcept {
    double* const to = rows + row * stride_ + first_;
    if (count_ == batch_lanes)
      x.store(to);
    else
      for (std::size_t lane = 0; lane < count_; ++lane) to[lane] = x.v[lane];
  }
  HAMELIN_INLINE void store(double* rows, std::size_t row, const BatchVec& a) const noexcept {
    store(rows, row, a.x);
    store(rows, row + 1, a.y);
    store(rows, row + 2, a.z);
  }

 private:
  std::size_t stride_, first_, count_;
};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::dynamics

#pragma once
#include "chain.hpp"
#include "lanes.hpp"

/// Forward kinematics of sixteen postures. Only for sources that are compiled once for each
/// instruction set.
namespace hamelin::search::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

/// Axes and origin of a link's frame.
struct Frame {
  Point x, y, z, p;
};

HAMELIN_INLINE Frame root_frame(const Chain& chain) {
  return {splat(chain.root_x), splat(chain.root_y), splat(chain.root_z), splat(chain.root_p)};
}
HAMELIN_INLINE Point combine(const Frame& f, const float* c) {
  return f.x * c[0] + f.y * c[1] + f.z * c[2];
}
HAMELIN_INLINE Point transform(const Frame& f, const float* c) {
  return f.p + combine(f, c);
}
HAMELIN_INLINE void turn_frame(Frame& f, const Joint& joint, const Reals& sine,
                               const Reals& cosine) {
  const Point y = f.y * joint.cos_alpha + f.z * joint.sin_alpha;
  f.z = f.z * joint.cos_alpha - f.y * joint.sin_alpha;
  f.y = y * cosine - f.x * sine;
  f.x = f.x * cosine + y * sine;
}
/// Goes on to the frame of the next link. @param q angle of the frame, or position
/// @return the direction about which, or along which, the joint moves
HAMELIN_INLINE Point next_frame(Frame& f, const Joint& joint, const Reals& q) {
  f.p = transform(f, joint.p);
  if (joint.turn == 0.0F) {
    const Point direction = combine(f, joint.slide);
    f.p = f.p + direction * q;
    turn_frame(f, joint, splat(joint.sine), splat(joint.cosine));
    return direction;
  }
  Reals sine, cosine;
  sincos(q, sine, cosine);
  turn_frame(f, joint, sine, cosine);
  return f.z;
}

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::search::kernel

#pragma once
#include "hamelin/dynamics/kernel/spatial_operator.hpp"
#include "hamelin/geometry/small.hpp"
#include "hamelin/model/chain.hpp"

namespace hamelin::dynamics::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

/// The operations of the sweeps in SE(3): twists [w; v], wrenches [t; f], articulated inertias, and
/// their changes between a link's joint-aligned frame and its parent's. kernel/planar.hpp has the
/// same names for SE(2). S is the scalar, double or Lanes. `Mixed` chains may have prismatic joints
/// and rotor inertias; otherwise the code for them is left out.
template <class S, bool Mixed = true>
struct Spatial : SpatialOperator<S, Mixed> {
  using Base = SpatialOperator<S, Mixed>;
  using Base::inertia;
  using Base::is_prismatic;
  using Base::offset;
  using Base::to_child;
  using Base::vec;
  using typename Base::Force;
  using typename Base::Link;
  using typename Base::Moment;
  using typename Base::Placement;

  static constexpr bool root_axes = false;  ///< each frame rotates with its link
  using Chain = model::SpatialChain;

  /// The state that Newton–Euler passes outwards: angular velocity w, angular acceleration dw,
  /// acceleration a of the frame's origin, and turn = Ω = hat(dw) + hat(w)², with which a point r
  /// accelerates as a + Ω r, docs/theory.md (2.10).
  struct Flow {
    Vec3<S> w, dw, a;
    Mat3<S> turn;
  };

  HAMELIN_INLINE static Flow root_flow(const Chain& chain) noexcept {
    const Vec3<S> o = vec({0, 0, 0});
    return {o, o, vec({-chain.gravity.x, -chain.gravity.y, -chain.gravity.z}), {o, o, o}};
  }
  /// Newton–Euler outwards: the parent's flow in the child's frame, plus joint rate v and
  /// acceleration a.
  HAMELIN_INLINE static Flow advance(const Link& l, const Placement& x, const Flow& parent, S v,
                                     S a) noexcept {
    Flow out{to_child(l, x, parent.w),
             to_child(l, x, parent.dw),
             to_child(l, x, parent.a + parent.turn * offset(l, x)),
             {}};
    if (is_prismatic(l)) {
      out.a.x += S(2) * out.w.y * v;
      out.a.y -= S(2) * out.w.x * v;
      out.a.z += a;
    } else {
      out.dw.x += out.w.y * v;
      out.dw.y -= out.w.x * v;
      out.dw.z += a;
      out.w.z += v;
    }
    const Vec3<S>&w = out.w, &dw = out.dw;
    const S xx = w.x * w.x, yy = w.y * w.y, zz = w.z * w.z, xy = w.x * w.y, xz = w.x * w.z,
            yz = w.y * w.z;
    out.turn = {{-(yy + zz), xy - dw.z, xz + dw.y},
                {xy + dw.z, -(xx + zz), yz - dw.x},
                {xz - dw.y, yz + dw.x, -(xx + yy)}};
    return out;
  }
  /// The wrench about the frame's origin that gives the rigid link this motion. Gravity enters
  /// through the root's acceleration.
  HAMELIN_INLINE static Force inertial_force(const Link& l, const Placement&,
                                             const Flow& k) noexcept {
    const Vec3<S> h = vec(l.moment);
    const Sym3<S> I = inertia(l);
    return {I * k.dw + cross(k.w, I * k.w) + cross(h, k.a), k.a * S(l.mass) + k.turn * h};
  }

  /// A vector that is constant in the world, in the axes of a link's frame.
  using Direction = Vec3<S>;
  HAMELIN_INLINE static Direction gravity(const Chain& chain) noexcept {
    return vec(chain.gravity);
  }
  /// −g · (first moment), the potential energy of all links relative to the root's origin.
  HAMELIN_INLINE static S potential(const Chain& chain, const Moment& k) noexcept {
    return -dot(vec(chain.gravity), k.h);
  }
  /// The torque of gravity on the joint, −∂U/∂q, with gravity g in the link's frame and the
  /// outboard moment k: docs/theory.md (2.7).
  HAMELIN_INLINE static S gravity_torque(const Link& l, const Direction& g,
                                         const Moment& k) noexcept {
    return is_prismatic(l) ? k.m * g.z : k.h.x * g.y - k.h.y * g.x;
  }
};

/// Mixed: with prismatic joints and rotor inertias. Plain: without.
template <class S>
using SpatialMixed = Spatial<S, true>;
template <class S>
using SpatialPlain = Spatial<S, false>;

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::dynamics::kernel

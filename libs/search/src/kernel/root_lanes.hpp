#pragma once
#include "chain.hpp"

namespace hamelin::search::kernel {

/// Poses that the tip is to have, one for each lane.
struct RootTargets {
  alignas(64) float p[3][lanes], x[3][lanes], y[3][lanes], z[3][lanes];
  float tip_p[3], tip_x[3], tip_y[3], tip_z[3];  ///< the tip in the frame of its link
  int tip_link;
  bool turns;                 ///< whether the rotation counts
  float reach_m, reach_sine;  ///< how near is enough: distance, and sine of the angle
};

/// Postures that move towards their targets, and the box that they stay in: angles of the frames,
/// or positions.
struct RootPostures {
  alignas(64) float q[joints_max][lanes];
  float lower[joints_max], upper[joints_max];
};

struct RootKernels {
  /// So many steps of damped least squares, docs/theory.md (15.16), fewer if all lanes are near.
  /// @return bits of the lanes that are near enough
  unsigned (*advance)(const Chain& chain, const RootTargets& targets, RootPostures& postures,
                      int steps) noexcept;
};

}  // namespace hamelin::search::kernel

#pragma once

namespace hamelin::search::kernel {

/// Postures that are computed at once, on every instruction set.
inline constexpr int lanes = 16;
inline constexpr unsigned all_lanes = (1U << lanes) - 1U;
/// Longer arms are computed one posture at a time.
inline constexpr int joints_max = 16;

/// Constants of one joint, as those of model::SpatialLink. All lengths in metres, in single
/// precision.
struct Joint {
  float cos_alpha, sin_alpha;
  float p[3];          ///< of the frame in that of the link before
  float slide[3];      ///< direction of a prismatic joint, in the frame of the link before
  float turn;          ///< ±1 about the frame's z; zero if prismatic
  float sine, cosine;  ///< of the constant angle of a prismatic joint
};

/// The joints of an arm, and the frame in which its first link moves.
struct Chain {
  int dof;
  const Joint* joints;
  float root_p[3], root_x[3], root_y[3], root_z[3];
};

}  // namespace hamelin::search::kernel

#pragma once
#include <vector>

#include "hamelin/geometry/small.hpp"

namespace hamelin::model {

/// Constants of one link in SE(3). The link's frame lies on its joint axis with z along the axis
/// and x along the direction of the common normal to the next axis. Its pose in the parent's frame
/// is p · Rx(α) · Rz(angle), where Rx and Rz are rotations about x and z, docs/theory.md
/// (1.17), (1.18):
///   revolute: angle = q + offset, p = p0;
///   prismatic: angle = offset, p = p0 + q · (0, −sin α, cos α).
/// The joint's screw is a unit vector, and a change of frame is two plane rotations and a
/// translation.
struct SpatialLink {
  int parent;
  bool prismatic;
  double cos_alpha, sin_alpha;
  double offset;                   ///< [rad]
  geometry::Vec3<double> p0;       ///< [m]
  double armature;                 ///< rotor inertia seen at the joint [kg m² or kg]
  double mass;                     ///< [kg]
  geometry::Vec3<double> moment;   ///< mass × COM, own frame [kg m]
  geometry::Sym3<double> inertia;  ///< about the frame's origin [kg m²]
};

/// Constants of one link in SE(2). Its pose in the parent's frame is p · R(angle), R a rotation,
/// docs/theory.md (1.20), (1.21):
///   revolute: angle = direction · q + offset, p = p0;
///   prismatic, along its own x: angle = offset, p = p0 + q · (cos offset, sin offset).
struct PlanarLink {
  int parent;
  bool prismatic;
  double direction;           ///< ±1: the joint's axis along or against the plane's normal
  double offset;              ///< [rad]
  double p0x, p0y;            ///< [m]
  double armature;            ///< rotor inertia seen at the joint [kg m² or kg]
  double mass;                ///< [kg]
  double moment_x, moment_y;  ///< mass × COM [kg m]
  double inertia;             ///< about the frame's origin [kg m²]
};

/// A chain in one of the two groups. Gravity [m/s²] is given in the axes of the root, the constant
/// frame that the parent index −1 denotes (Model::root).
struct SpatialChain {
  std::vector<SpatialLink> links;
  geometry::Vec3<double> gravity;
  double potential_constant;  ///< the constant part of U = −Σ m g·p, not in the sweep [J]
};
struct PlanarChain {
  std::vector<PlanarLink> links;
  double gravity_x, gravity_y;
  double potential_constant;  ///< as above, including out-of-plane offsets [J]
};

}  // namespace hamelin::model

#pragma once
#include <vector>

#include "hamelin/geometry/small.hpp"

namespace hamelin::model {

/// Constants of one link in SE(3). Its frame sits on its own joint axis with z along it, and x along the common normal
/// direction to the next axis, so that from the parent's frame it is  p · Rx(α) · Rz(angle):
///   revolute: angle = q + offset, p = p0;   prismatic: angle = offset, p = p0 + q · (0, −sin α, cos α).
/// The joint's screw is then a unit vector, and every change of frame is two plane rotations and a shift.
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

/// Constants of one link in SE(2): from the parent's frame  p · R(angle).
///   revolute: angle = direction · q + offset;   prismatic along own x: p = p0 + q · (cos offset, sin offset).
struct PlanarLink {
  int parent;
  bool prismatic;
  double direction;           ///< +1 or −1: the joint's axis along the plane's normal or against it
  double offset;              ///< [rad]
  double p0x, p0y;            ///< [m]
  double armature;            ///< rotor inertia seen at the joint [kg m² or kg]
  double mass;                ///< [kg]
  double moment_x, moment_y;  ///< mass × COM [kg m]
  double inertia;             ///< about the frame's origin [kg m²]
};

/// A chain in one of the two groups. Gravity is given in the axes of the root, the constant frame that parents −1 means
/// (Model::root) [m/s²].
struct SpatialChain {
  std::vector<SpatialLink> links;
  geometry::Vec3<double> gravity;
  double potential_constant;  ///< what U = −Σ m g·p counts besides the sweep's root-frame part [J]
};
struct PlanarChain {
  std::vector<PlanarLink> links;
  double gravity_x, gravity_y;
  double potential_constant;  ///< as above, out-of-plane offsets included [J]
};

}  // namespace hamelin::model

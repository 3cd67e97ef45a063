#pragma once
#include <cstddef>

#include "hamelin/geometry/small.hpp"

namespace hamelin::dynamics {

/// A link's joint-aligned frame in that of its parent, in one form for chains in space and in the
/// plane: p0 + q slide, then a turn about x by α and about z by sign q + offset (revolute) or by
/// offset (prismatic).
struct BatchLink {
  double cos_alpha, sin_alpha, sign, offset;
  geometry::Vec3<double> p0, slide;
  bool prismatic;
  bool along_x;  ///< the axis of a prismatic joint is x of its frame, else z; a sign does not apply
};

/// A rotation by its columns, and a position.
struct BatchPose {
  geometry::Vec3<double> x, y, z, p;
};

}  // namespace hamelin::dynamics

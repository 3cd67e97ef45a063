#pragma once
#include <cstddef>

#include "hamelin/core/isa.hpp"
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

struct FrameBatchCall {
  const BatchLink* links;
  std::size_t dof;
  std::size_t moving;  ///< how many of the links move the frame
  BatchPose root;      ///< in the world
  BatchPose frame;     ///< in the last of these links, or in the world if there is none
  bool local;          ///< the Jacobians are in the axes of the frame
  bool about_origin;   ///< they are of the body's point at the world's origin, else of the frame's
  void* memory;
  std::size_t states, stride;
  const double* q;
  double *poses, *jacobians;  ///< null: not wanted
};

struct FrameBatchKernel {
  std::size_t (*bytes)(std::size_t dof) noexcept;
  void (*evaluate)(const FrameBatchCall& call) noexcept;
};

}  // namespace hamelin::dynamics

#pragma once
#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/geometry/small.hpp"

namespace hamelin::dynamics {

/// A frame that a caller gave by its index.
inline const model::Model::NamedFrame& named_frame(const char* function, const Model& model,
                                                   int frame) {
  const auto& frames = model.frames();
  if (frame < 0 || static_cast<std::size_t>(frame) >= frames.size()) [[unlikely]]
    throw Error(ErrorCode::usage, formatted("{}: frame {} given, expected an index from 0 to {}",
                                            function, frame, frames.size() - 1));
  return frames[static_cast<std::size_t>(frame)];
}

/// Its world pose; ws has the poses of the links.
inline geometry::SE3 pose_of(const Workspace& ws, const model::Model::NamedFrame& frame) {
  if (frame.link < 0) return frame.in_link;
  const Workspace::Frame& at = ws.frames[static_cast<std::size_t>(frame.link)];
  return geometry::SE3{at.R, at.p} * frame.in_link;
}

inline geometry::Vec3<double> vec3(const Eigen::Vector3d& x) noexcept {
  return {x.x(), x.y(), x.z()};
}

inline bool is_prismatic(const Model& model, int joint) {
  return model.robot().links[static_cast<std::size_t>(joint)].joint.type ==
         model::JointType::prismatic;
}

/// The velocity of a world point per rate of a joint that moves it.
inline Eigen::Vector3d velocity_column(const Model& model, const Workspace& ws, int joint,
                                       const Eigen::Vector3d& point) {
  const Workspace::Frame& at = ws.frames[static_cast<std::size_t>(joint)];
  return is_prismatic(model, joint) ? at.axis : Eigen::Vector3d(at.axis.cross(point - at.p));
}

/// τ from the sums in ws.forces, each a moment about the origin of its link's joint-aligned frame
/// and a force, world axes; they are summed inwards.
void gather_forces(const Model& model, Workspace& ws, double* tau);

}  // namespace hamelin::dynamics

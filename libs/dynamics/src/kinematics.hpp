#pragma once
#include <Eigen/Geometry>

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

/// Refuses external wrenches on a frame that the model does not have.
template <class Wrenches>
void check_frames(const char* function, const Model& model, const Wrenches& wrenches) {
  for (const auto& each : wrenches) (void)named_frame(function, model, each.frame);
}

/// The frame's world pose; ws has the poses of the links.
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

/// How a body moves, by one of its points, in world axes: docs/theory.md (2.34), (2.35).
struct BodyMotion {
  Eigen::Vector3d omega = Eigen::Vector3d::Zero(), velocity = Eigen::Vector3d::Zero();
  Eigen::Vector3d omega_rate = Eigen::Vector3d::Zero(), acceleration = Eigen::Vector3d::Zero();

  /// To another point of the same body.
  void shift(const Eigen::Vector3d& by) noexcept {
    acceleration += omega_rate.cross(by) + omega.cross(omega.cross(by));
    velocity += omega.cross(by);
  }
  /// From the link before joint j, or the root, to the link that the joint moves, by the origins of
  /// their joint-aligned frames; ws has the poses.
  void advance(const Model& model, const Workspace& ws, int j, double v, double a) noexcept {
    const Workspace::Frame& at = ws.frames[static_cast<std::size_t>(j)];
    if (j > 0) shift(at.p - ws.frames[static_cast<std::size_t>(j - 1)].p);
    if (is_prismatic(model, j)) {
      acceleration += at.axis * a + 2.0 * omega.cross(at.axis) * v;
      velocity += at.axis * v;
    } else {
      omega_rate += at.axis * a + omega.cross(at.axis) * v;
      omega += at.axis * v;
    }
  }
};

/// The inertia of a point mass about an origin, from which it is displaced by c.
inline Eigen::Matrix3d point_inertia(double mass, const Eigen::Vector3d& c) noexcept {
  return mass * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
}

/// τ from the sums in ws.forces, each a moment about the origin of its link's joint-aligned frame
/// and a force, world axes; they are summed inwards.
void gather_forces(const Model& model, Workspace& ws, double* tau);

}  // namespace hamelin::dynamics

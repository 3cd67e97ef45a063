#include "hamelin/dynamics/frames.hpp"

#include <Eigen/Geometry>

#include "kinematics.hpp"

namespace hamelin::dynamics {

namespace {

using Eigen::Vector3d;
using geometry::SE3;

const model::Model::NamedFrame& checked(const char* function, const Model& model,
                                        const Workspace& ws, int frame) {
  (void)detail::Call::with_poses(function, model, ws.owner);
  return named_frame(function, model, frame);
}

// Of a body's point in the world.
// @param a null: accelerations of zero
BodyMotion motion_of(const Model& model, const Workspace& ws, int link, const Vector3d& point,
                     const double* v, const double* a) {
  BodyMotion motion;
  for (int j = 0; j <= link; ++j) motion.advance(model, ws, j, v[j], a != nullptr ? a[j] : 0.0);
  motion.shift(point - ws.frames[static_cast<std::size_t>(link)].p);
  return motion;
}

// docs/theory.md (2.33)
Vector6d twist_of(const BodyMotion& motion, Reference reference, const SE3& pose) {
  Vector6d twist;
  switch (reference) {
    case Reference::world:
      twist << motion.omega, motion.velocity - motion.omega.cross(pose.p());
      break;
    case Reference::local:
      twist << pose.R().transpose() * motion.omega, pose.R().transpose() * motion.velocity;
      break;
    case Reference::local_world_aligned:
      twist << motion.omega, motion.velocity;
      break;
  }
  return twist;
}

// docs/theory.md (2.36)
Vector6d twist_rate_of(const BodyMotion& motion, Reference reference, const SE3& pose) {
  Vector6d rate;
  switch (reference) {
    case Reference::world:
      rate << motion.omega_rate, motion.acceleration - motion.omega_rate.cross(pose.p()) -
                                     motion.omega.cross(motion.velocity);
      break;
    case Reference::local:
      rate << pose.R().transpose() * motion.omega_rate,
          pose.R().transpose() * (motion.acceleration - motion.omega.cross(motion.velocity));
      break;
    case Reference::local_world_aligned:
      rate << motion.omega_rate, motion.acceleration;
      break;
  }
  return rate;
}

Vector6d rate_of(const Model& model, const Workspace& ws, const model::Model::NamedFrame& frame,
                 Reference reference, const double* v, const double* a) {
  if (frame.link < 0) return Vector6d::Zero();
  const SE3 pose = pose_of(ws, frame);
  return twist_rate_of(motion_of(model, ws, frame.link, pose.p(), v, a), reference, pose);
}

}  // namespace

const char* name_of(Reference reference) noexcept {
  switch (reference) {
    case Reference::world:
      return "world";
    case Reference::local:
      return "local";
    case Reference::local_world_aligned:
      break;
  }
  return "local_world_aligned";
}

std::optional<Reference> reference_named(std::string_view name) noexcept {
  for (const Reference each : {Reference::world, Reference::local, Reference::local_world_aligned})
    if (name == name_of(each)) return each;
  return std::nullopt;
}

SE3 frame_pose(const Model& model, const Workspace& ws, int frame) {
  return pose_of(ws, checked("frame_pose", model, ws, frame));
}

void frame_jacobian(const Model& model, const Workspace& ws, int frame, Reference reference,
                    Eigen::Ref<Matrix6Xd> J) {
  const auto& given = checked("frame_jacobian", model, ws, frame);
  detail::Call("frame_jacobian", model, ws.owner).size("J (columns)", J.cols(), ws.owner.dof);
  J.setZero();
  const SE3 pose = pose_of(ws, given);
  const Vector3d point = reference == Reference::world ? Vector3d::Zero() : pose.p();
  for (int j = 0; j <= given.link; ++j) {
    if (!is_prismatic(model, j)) J.col(j).head<3>() = ws.frames[static_cast<std::size_t>(j)].axis;
    J.col(j).tail<3>() = velocity_column(model, ws, j, point);
    if (reference != Reference::local) continue;
    J.col(j).head<3>() = (pose.R().transpose() * J.col(j).head<3>()).eval();
    J.col(j).tail<3>() = (pose.R().transpose() * J.col(j).tail<3>()).eval();
  }
}

Vector6d frame_velocity(const Model& model, const Workspace& ws, int frame, Reference reference,
                        const ConstVectorRef& v) {
  const auto& given = checked("frame_velocity", model, ws, frame);
  detail::Call("frame_velocity", model, ws.owner).joints("v", v);
  if (given.link < 0) return Vector6d::Zero();
  const SE3 pose = pose_of(ws, given);
  return twist_of(motion_of(model, ws, given.link, pose.p(), v.data(), nullptr), reference, pose);
}

Vector6d frame_drift(const Model& model, const Workspace& ws, int frame, Reference reference,
                     const ConstVectorRef& v) {
  const auto& given = checked("frame_drift", model, ws, frame);
  detail::Call("frame_drift", model, ws.owner).joints("v", v);
  return rate_of(model, ws, given, reference, v.data(), nullptr);
}

Vector6d frame_acceleration(const Model& model, const Workspace& ws, int frame, Reference reference,
                            const ConstVectorRef& v, const ConstVectorRef& a) {
  const auto& given = checked("frame_acceleration", model, ws, frame);
  detail::Call("frame_acceleration", model, ws.owner).joints("v", v).joints("a", a);
  return rate_of(model, ws, given, reference, v.data(), a.data());
}

}  // namespace hamelin::dynamics

#pragma once
#include <Eigen/Core>
#include <optional>
#include <string_view>

#include "hamelin/dynamics/dynamics.hpp"

/// Named frames: poses, Jacobians, velocities and accelerations, docs/theory.md (2.33)–(2.36). A
/// frame is an index into Model::frames(), which Model::frame(name) looks up; Model::tip_frame is
/// the tip. Twists are [angular; linear]. All functions read the poses of forward_kinematics, in
/// O(depth of the link).
namespace hamelin::dynamics {

using geometry::Vector6d;

/// In which terms a twist of a frame is given.
enum class Reference {
  world,               ///< of the body's point at the world's origin, world axes
  local,               ///< of the frame's origin, axes of the frame
  local_world_aligned  ///< of the frame's origin, world axes
};

/// "world", "local" or "local_world_aligned".
[[nodiscard]] const char* name_of(Reference reference) noexcept;
/// The reference of a name; none if it is unknown.
[[nodiscard]] std::optional<Reference> reference_named(std::string_view name) noexcept;

/// World pose of a frame.
[[nodiscard]] geometry::SE3 frame_pose(const Model& model, const Workspace& ws, int frame);

/// J with J v the twist of the frame, 6 × dof; the columns of joints outboard of it are zero.
void frame_jacobian(const Model& model, const Workspace& ws, int frame, Reference reference,
                    Eigen::Ref<Matrix6Xd> J);

/// The twist J v [rad/s; m/s], without J.
[[nodiscard]] Vector6d frame_velocity(const Model& model, const Workspace& ws, int frame,
                                      Reference reference, const ConstVectorRef& v);

/// J̇ v [rad/s²; m/s²]: the rate of the twist at accelerations of zero, where J is the Jacobian of
/// the same reference.
[[nodiscard]] Vector6d frame_drift(const Model& model, const Workspace& ws, int frame,
                                   Reference reference, const ConstVectorRef& v);

/// J a + J̇ v [rad/s²; m/s²]: the rate of the twist. For local_world_aligned its linear part is the
/// acceleration of the frame's origin.
[[nodiscard]] Vector6d frame_acceleration(const Model& model, const Workspace& ws, int frame,
                                          Reference reference, const ConstVectorRef& v,
                                          const ConstVectorRef& a);

}  // namespace hamelin::dynamics

#include "hamelin/dynamics/wrenches.hpp"

#include <Eigen/Geometry>

#include "kinematics.hpp"

namespace hamelin::dynamics {

namespace {

using Eigen::Vector3d;
using geometry::SE3;

void sum(const char* function, const Model& model, Workspace& ws,
         std::span<const ExternalWrench> wrenches, double* tau) {
  for (auto& total : ws.forces) total = {Vector3d::Zero(), Vector3d::Zero()};
  for (const ExternalWrench& each : wrenches) {
    const auto& frame = named_frame(function, model, each.frame);
    if (frame.link < 0) continue;
    const SE3 pose = pose_of(ws, frame);
    const Vector6d given = aligned_wrench(each, pose);
    const Vector3d force = given.tail<3>();
    const auto link = static_cast<std::size_t>(frame.link);
    ws.forces[link].linear += force;
    ws.forces[link].angular += given.head<3>() + (pose.p() - ws.frames[link].p).cross(force);
  }
  gather_forces(model, ws, tau);
}

}  // namespace

Vector6d aligned_wrench(const ExternalWrench& given, const SE3& pose) {
  const Vector3d moment = given.wrench.head<3>(), force = given.wrench.tail<3>();
  Vector6d out = given.wrench;
  if (given.reference == Reference::world) out.head<3>() = moment - pose.p().cross(force);
  if (given.reference == Reference::local) out << pose.R() * moment, pose.R() * force;
  return out;
}

void external_torque(const Model& model, Workspace& ws, const ConstVectorRef& q,
                     std::span<const ExternalWrench> wrenches, VectorRef tau) {
  detail::Call("external_torque", model, ws.owner).joints("q", q).joints("tau", tau);
  check_frames("external_torque", model, wrenches);
  detail::forward_kinematics(model, ws, q.data());
  sum("external_torque", model, ws, wrenches, tau.data());
}

void external_torque(const Model& model, Workspace& ws, std::span<const ExternalWrench> wrenches,
                     VectorRef tau) {
  detail::Call::with_poses("external_torque", model, ws.owner).joints("tau", tau);
  check_frames("external_torque", model, wrenches);
  sum("external_torque", model, ws, wrenches, tau.data());
}

void inverse_dynamics(const Model& model, Workspace& ws, const ConstVectorRef& q,
                      const ConstVectorRef& v, const ConstVectorRef& a,
                      std::span<const ExternalWrench> wrenches, VectorRef tau) {
  external_torque(model, ws, q, wrenches, ws.column_in);
  inverse_dynamics(model, ws, q, v, a, tau);
  tau -= ws.column_in;
}

void forward_dynamics(const Model& model, Workspace& ws, const ConstVectorRef& q,
                      const ConstVectorRef& v, const ConstVectorRef& tau,
                      std::span<const ExternalWrench> wrenches, VectorRef a) {
  external_torque(model, ws, q, wrenches, ws.column_in);
  detail::Call("forward_dynamics", model, ws.owner).joints("tau", tau);
  ws.column_in += tau;
  forward_dynamics(model, ws, q, v, ws.column_in, a);
}

}  // namespace hamelin::dynamics

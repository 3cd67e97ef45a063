#include <Eigen/Geometry>

#include "hamelin/dynamics/wrenches.hpp"
#include "kinematics.hpp"

namespace hamelin::dynamics {

namespace {

using Eigen::Vector3d;
using geometry::SE3;

// docs/theory.md (2.39) for one wrench. ws has poses.
void add_derivative(const Model& model, const Workspace& ws, const ExternalWrench& given,
                    const model::Model::NamedFrame& frame, MatrixRef dtau_dq) {
  const SE3 pose = pose_of(ws, frame);
  const Vector6d wrench = aligned_wrench(given, pose);
  const Vector3d m = wrench.head<3>(), f = wrench.tail<3>();
  for (int j = 0; j <= frame.link; ++j) {
    const Vector3d turn = is_prismatic(model, j) ? Vector3d::Zero()
                                                 : ws.frames[static_cast<std::size_t>(j)].axis,
                   shift = velocity_column(model, ws, j, pose.p());
    Vector6d change = Vector6d::Zero();
    if (given.reference == Reference::local) change << turn.cross(m), turn.cross(f);
    if (given.reference == Reference::world) change.head<3>() = -shift.cross(f);
    for (int i = 0; i <= frame.link; ++i) {
      const Vector3d turn_i = is_prismatic(model, i) ? Vector3d::Zero()
                                                     : ws.frames[static_cast<std::size_t>(i)].axis,
                     shift_i = velocity_column(model, ws, i, pose.p());
      const double moved = j <= i ? turn.cross(turn_i).dot(m) + turn.cross(shift_i).dot(f)
                                  : turn_i.cross(shift).dot(f);
      dtau_dq(i, j) += moved + turn_i.dot(change.head<3>()) + shift_i.dot(change.tail<3>());
    }
  }
}

void add_derivatives(const char* function, const Model& model, Workspace& ws,
                     std::span<const ExternalWrench> wrenches, MatrixRef dtau_dq) {
  for (const ExternalWrench& each : wrenches)
    add_derivative(model, ws, each, named_frame(function, model, each.frame), dtau_dq);
}

}  // namespace

void external_torque_derivative(const Model& model, Workspace& ws, const ConstVectorRef& q,
                                std::span<const ExternalWrench> wrenches, MatrixRef dtau_dq) {
  constexpr const char* function = "external_torque_derivative";
  detail::Call(function, model, ws.owner)
      .joints("q", q)
      .size("dtau_dq (rows)", dtau_dq.rows(), ws.owner.dof)
      .size("dtau_dq (columns)", dtau_dq.cols(), ws.owner.dof);
  check_frames(function, model, wrenches);
  detail::forward_kinematics(model, ws, q.data());
  dtau_dq.setZero();
  add_derivatives(function, model, ws, wrenches, dtau_dq);
}

void inverse_dynamics_derivatives(const Model& model, DerivativesWorkspace& ws,
                                  const ConstVectorRef& q, const ConstVectorRef& v,
                                  const ConstVectorRef& a, std::span<const ExternalWrench> wrenches,
                                  MatrixRef dtau_dq, MatrixRef dtau_dv, MatrixRef dtau_da) {
  constexpr const char* function = "inverse_dynamics_derivatives";
  check_frames(function, model, wrenches);
  inverse_dynamics_derivatives(model, ws, q, v, a, dtau_dq, dtau_dv, dtau_da);  // places the links
  if (wrenches.empty()) return;
  dtau_dq *= -1.0;
  add_derivatives(function, model, ws.ws, wrenches, dtau_dq);
  dtau_dq *= -1.0;
}

void forward_dynamics_derivatives(const Model& model, DerivativesWorkspace& ws,
                                  const ConstVectorRef& q, const ConstVectorRef& v,
                                  const ConstVectorRef& tau,
                                  std::span<const ExternalWrench> wrenches, VectorRef a,
                                  MatrixRef da_dq, MatrixRef da_dv, MatrixRef da_dtau) {
  if (wrenches.empty()) {
    forward_dynamics_derivatives(model, ws, q, v, tau, a, da_dq, da_dv, da_dtau);
    return;
  }
  external_torque_derivative(model, ws.ws, q, wrenches, ws.external);
  external_torque(model, ws.ws, wrenches, ws.ws.column_in);
  detail::Call("forward_dynamics_derivatives", model, ws.ws.owner).joints("tau", tau);
  ws.ws.column_in += tau;
  forward_dynamics_derivatives(model, ws, q, v, ws.ws.column_in, a, da_dq, da_dv, da_dtau);
  da_dq.noalias() += da_dtau * ws.external;
}

}  // namespace hamelin::dynamics

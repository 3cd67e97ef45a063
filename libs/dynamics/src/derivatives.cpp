#include "hamelin/dynamics/derivatives.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

namespace hamelin::dynamics {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

using Pair = DerivativesWorkspace::Pair;
using Axis = DerivativesWorkspace::Axis;
using Composite = DerivativesWorkspace::Composite;

// m × n for motions.
Pair cross(const Pair& m, const Pair& n) {
  return {m.angular.cross(n.angular), m.angular.cross(n.linear) + m.linear.cross(n.angular)};
}

// m ×* f for a motion and a wrench.
Pair cross_wrench(const Pair& m, const Pair& f) {
  return {m.angular.cross(f.angular) + m.linear.cross(f.linear), m.angular.cross(f.linear)};
}

Pair operator+(const Pair& a, const Pair& b) {
  return {a.angular + b.angular, a.linear + b.linear};
}
Pair operator*(double k, const Pair& a) {
  return {k * a.angular, k * a.linear};
}
double dot(const Pair& motion, const Pair& wrench) {
  return motion.angular.dot(wrench.angular) + motion.linear.dot(wrench.linear);
}

// I m: momentum of a motion, or the wrench of an acceleration.
Pair inertia_times(const Composite& c, const Pair& m) {
  return {c.second.trace() * m.angular - c.second * m.angular + c.moment.cross(m.linear),
          c.mass * m.linear + m.angular.cross(c.moment)};
}

// docs/theory.md (2.27)
Pair twice_coriolis_times(const Composite& c, const Pair& m) {
  return {2.0 * (c.flow.trace() * m.angular - c.flow * m.angular),
          2.0 * m.angular.cross(c.momentum)};
}

Matrix3d hat_times(const Vector3d& w, const Matrix3d& A) {
  Matrix3d out;
  for (int k = 0; k < 3; ++k) out.col(k) = w.cross(A.col(k));
  return out;
}

// A link's mass about the reference point, its motion, and the wrench that moves it.
void set_link(const model::Link& link, const Workspace::Frame& frame, const geometry::SE3& com,
              const Vector3d& origin, const Pair& velocity, const Pair& acceleration,
              Composite& out) {
  const Matrix3d R = frame.R * com.R();
  const Vector3d r = frame.p + frame.R * com.p() - origin;
  out.mass = link.mass_kg;
  out.moment = link.mass_kg * r;
  const Matrix3d about_com = R * link.inertia_kg_m2 * R.transpose();
  out.second = link.mass_kg * r * r.transpose() - about_com;
  out.second.diagonal().array() += 0.5 * about_com.trace();
  out.momentum = out.mass * velocity.linear + velocity.angular.cross(out.moment);
  out.flow = velocity.linear * out.moment.transpose() + hat_times(velocity.angular, out.second);
  out.wrench =
      inertia_times(out, acceleration) + cross_wrench(velocity, inertia_times(out, velocity));
}

void add(const Composite& from, Composite& to) {
  to.mass += from.mass;
  to.moment += from.moment;
  to.second += from.second;
  to.momentum += from.momentum;
  to.flow += from.flow;
  to.wrench = to.wrench + from.wrench;
}

// docs/theory.md (2.24), (2.25)
void sweep_outwards(const Model& model, DerivativesWorkspace& ws, const ConstVectorRef& v,
                    const ConstVectorRef& a) {
  const Vector3d origin = model.base().p();
  Pair velocity{Vector3d::Zero(), Vector3d::Zero()},
      acceleration{Vector3d::Zero(), -model.gravity()};
  for (std::size_t i = 0; i < ws.axes.size(); ++i) {
    const model::Link& link = model.robot().links[i];
    const Workspace::Frame& frame = ws.ws.frames[i];
    Axis& axis = ws.axes[i];
    if (link.joint.type == model::JointType::prismatic)
      axis.screw = {Vector3d::Zero(), frame.axis};
    else
      axis.screw = {frame.axis, (frame.p - origin).cross(frame.axis)};
    axis.first = cross(velocity, axis.screw);
    axis.second = cross(acceleration, axis.screw) + cross(velocity, axis.first);
    const auto k = static_cast<Index>(i);
    acceleration = acceleration + a[k] * axis.screw + v[k] * axis.first;
    velocity = velocity + v[k] * axis.screw;
    set_link(link, frame, model.com_in_frame(static_cast<int>(i)), origin, velocity, acceleration,
             ws.links[i]);
  }
}

// docs/theory.md (2.28)
void sweep_inwards(const Model& model, DerivativesWorkspace& ws, MatrixRef dq, MatrixRef dv,
                   MatrixRef M) {
  for (std::size_t i = ws.axes.size(); i-- > 0;) {
    const Composite& outboard = ws.links[i];
    const Axis& axis = ws.axes[i];
    const Pair column = inertia_times(outboard, axis.screw);
    const Vector3d row = 2.0 * (outboard.flow.trace() * axis.screw.angular -
                                outboard.flow.transpose() * axis.screw.angular +
                                outboard.momentum.cross(axis.screw.linear));
    const Pair by_q = twice_coriolis_times(outboard, axis.first) +
                      inertia_times(outboard, axis.second) +
                      cross_wrench(axis.screw, outboard.wrench);
    const Pair by_v =
        twice_coriolis_times(outboard, axis.screw) + 2.0 * inertia_times(outboard, axis.first);
    const auto r = static_cast<Index>(i);
    for (std::size_t j = 0; j <= i; ++j) {
      const Axis& inboard = ws.axes[j];
      const auto c = static_cast<Index>(j);
      dq(c, r) = dot(inboard.screw, by_q);
      dv(c, r) = dot(inboard.screw, by_v);
      dq(r, c) = row.dot(inboard.first.angular) + dot(inboard.second, column);
      dv(r, c) = row.dot(inboard.screw.angular) + 2.0 * dot(inboard.first, column);
      M(r, c) = M(c, r) = dot(inboard.screw, column);
    }
    M(r, r) += model.robot().links[i].joint.armature;
    if (i > 0) add(outboard, ws.links[i - 1]);
  }
}

void check_square(const detail::Call& call, Index n, const char* rows, const char* columns,
                  const MatrixRef& matrix) {
  call.size(rows, matrix.rows(), n).size(columns, matrix.cols(), n);
}

}  // namespace

DerivativesWorkspace::DerivativesWorkspace(const model::Model& model, Isa isa)
    : ws(model, isa),
      axes(static_cast<std::size_t>(model.dof())),
      links(axes.size()),
      mass(Eigen::MatrixXd::Zero(model.dof(), model.dof())),
      dq(mass),
      dv(mass),
      acceleration(Eigen::VectorXd::Zero(model.dof())) {}

void inverse_dynamics_derivatives(const Model& model, DerivativesWorkspace& ws,
                                  const ConstVectorRef& q, const ConstVectorRef& v,
                                  const ConstVectorRef& a, MatrixRef dtau_dq, MatrixRef dtau_dv,
                                  MatrixRef dtau_da) {
  const detail::Call call("inverse_dynamics_derivatives", model, ws.ws.owner);
  const Index n = ws.ws.owner.dof;
  call.joints("v", v).joints("a", a);
  check_square(call, n, "dtau_dq (rows)", "dtau_dq (columns)", dtau_dq);
  check_square(call, n, "dtau_dv (rows)", "dtau_dv (columns)", dtau_dv);
  check_square(call, n, "dtau_da (rows)", "dtau_da (columns)", dtau_da);
  forward_kinematics(model, ws.ws, q);
  sweep_outwards(model, ws, v, a);
  sweep_inwards(model, ws, dtau_dq, dtau_dv, dtau_da);
}

// docs/theory.md (2.29)
void forward_dynamics_derivatives(const Model& model, DerivativesWorkspace& ws,
                                  const ConstVectorRef& q, const ConstVectorRef& v,
                                  const ConstVectorRef& tau, VectorRef a, MatrixRef da_dq,
                                  MatrixRef da_dv, MatrixRef da_dtau) {
  const detail::Call call("forward_dynamics_derivatives", model, ws.ws.owner);
  const Index n = ws.ws.owner.dof;
  check_square(call, n, "da_dq (rows)", "da_dq (columns)", da_dq);
  check_square(call, n, "da_dv (rows)", "da_dv (columns)", da_dv);
  check_square(call, n, "da_dtau (rows)", "da_dtau (columns)", da_dtau);
  forward_dynamics(model, ws.ws, q, v, tau, a);
  inverse_dynamics_derivatives(model, ws, q, v, a, da_dq, da_dv, ws.mass);
  const Eigen::LLT<MatrixRef> factor(ws.mass);
  factor.solveInPlace(da_dq);
  factor.solveInPlace(da_dv);
  da_dq = -da_dq;
  da_dv = -da_dv;
  da_dtau.setIdentity();
  factor.solveInPlace(da_dtau);
}

}  // namespace hamelin::dynamics

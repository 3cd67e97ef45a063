#include "force_derivatives.hpp"

#include <Eigen/Geometry>

#include "kernel_arguments.hpp"

namespace hamelin::integration {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

constexpr double law_difference = 1e-5;  // increment of the central differences of a wrench law

}  // namespace

ForceDerivatives::ForceDerivatives(Index dof)
    : by_q(Eigen::MatrixXd::Zero(dof, dof)),
      by_v(by_q),
      force(VectorXd::Zero(dof)),
      external_by_q(by_q),
      external_by_v(by_q),
      external(force),
      J_(6, dof),
      torque_(force),
      q_(force),
      v_(force) {}

void ForceDerivatives::evaluate(const Model& model, const Channels& channels,
                                dynamics::Workspace& ws, const ConstVectorRef& q,
                                const ConstVectorRef& v) {
  add_joint_forces(channels, v);
  if (!channels.wrenches.empty()) add_held_wrenches(model, channels, ws, q);
  if (!channels.gyroscopic.empty()) add_gyroscopic(model, channels, ws, q, v);
}

void ForceDerivatives::evaluate(const Model& model, const Channels& channels,
                                dynamics::Workspace& ws, const ConstVectorRef& q,
                                const ConstVectorRef& v, WrenchForces& wrenches) {
  if (!channels.wrench_law) return evaluate(model, channels, ws, q, v);
  add_joint_forces(channels, v);
  add_wrench_law(q, v, wrenches);
  if (!channels.gyroscopic.empty()) add_gyroscopic(model, channels, ws, q, v);
}

void ForceDerivatives::add_joint_forces(const Channels& channels, const ConstVectorRef& v) {
  by_q.setZero();
  by_v.setZero();
  external_by_q.setZero();
  external_by_v.setZero();
  external.setZero();
  const kernel::Forces joints = joint_forces(channels);
  for (Index i = 0; i < v.size(); ++i) {
    const auto joint = static_cast<std::size_t>(i);
    force[i] = kernel::joint_force(joints, joint, v[i]);
    by_v(i, i) = -kernel::joint_force_slope(joints, joint, v[i]);
  }
}

void ForceDerivatives::add_held_wrenches(const Model& model, const Channels& channels,
                                         dynamics::Workspace& ws, const ConstVectorRef& q) {
  dynamics::external_torque_derivative(model, ws, q, channels.wrenches, external_by_q);
  dynamics::external_torque(model, ws, channels.wrenches, external);
  force += external;
  by_q += external_by_q;
}

void ForceDerivatives::add_wrench_law(const ConstVectorRef& q, const ConstVectorRef& v,
                                      WrenchForces& wrenches) {
  q_ = q;
  v_ = v;
  const auto column = [&](double& number, auto&& derivative) {
    const double at = number;
    number = at + law_difference;
    torque_ = wrenches.evaluate(q_, v_);
    number = at - law_difference;
    derivative = (torque_ - wrenches.evaluate(q_, v_)) / (2.0 * law_difference);
    number = at;
  };
  for (Index j = 0; j < q_.size(); ++j) {
    column(q_[j], external_by_q.col(j));
    column(v_[j], external_by_v.col(j));
  }
  external = wrenches.evaluate(q_, v_);
  force += external;
  by_q += external_by_q;
  by_v += external_by_v;
}

void ForceDerivatives::add_gyroscopic(const Model& model, const Channels& channels,
                                      dynamics::Workspace& ws, const ConstVectorRef& q,
                                      const ConstVectorRef& v) {
  dynamics::gyroscopic_torque(model, ws, q, v, channels.gyroscopic, torque_);
  force += torque_;
  for (const auto& term : channels.gyroscopic) add(model, term, ws, v);
}

// docs/theory.md (4.34). A displacement of joint j turns the column J_i of a joint i ≥ j by
// σ_j × J_i; for i < j the column changes by σ_i × J_j. The same holds for ẋ = Σ J_i v_i.
void ForceDerivatives::add(const Model& model, const dynamics::GyroscopicTerm& term,
                           const dynamics::Workspace& ws, const ConstVectorRef& v) {
  const Vector3d at = dynamics::point_position(model, ws, term.link, term.point_link);
  dynamics::frame_jacobian(model, ws, term.link, at, J_);
  const Vector3d velocity = J_.bottomRows<3>() * v, f = term.w_world.cross(velocity);
  const Index n = v.size();
  const auto turned = [&](Index i, Index j) -> Vector3d {  // ∂J_i/∂q_j
    const Index inner = std::min(i, j), outer = std::max(i, j);
    return J_.col(inner).head<3>().cross(J_.col(outer).tail<3>());
  };
  for (Index j = 0; j < n; ++j) {
    Vector3d velocity_by_q = Vector3d::Zero();
    for (Index i = 0; i < n; ++i) velocity_by_q += turned(i, j) * v[i];
    const Vector3d by_position = term.w_world.cross(velocity_by_q),
                   by_velocity = term.w_world.cross(J_.col(j).tail<3>());
    for (Index i = 0; i < n; ++i) {
      by_q(i, j) += turned(i, j).dot(f) + J_.col(i).tail<3>().dot(by_position);
      by_v(i, j) += J_.col(i).tail<3>().dot(by_velocity);
    }
  }
}

}  // namespace hamelin::integration

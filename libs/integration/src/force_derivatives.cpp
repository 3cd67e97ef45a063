#include "force_derivatives.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace hamelin::integration {

using Eigen::Index;
using Eigen::Vector3d;

ForceDerivatives::ForceDerivatives(Index dof)
    : by_q(Eigen::MatrixXd::Zero(dof, dof)),
      by_v(by_q),
      force(VectorXd::Zero(dof)),
      J_(6, dof),
      slope_(by_q),
      torque_(force) {}

void ForceDerivatives::evaluate(const Model& model, const Channels& channels,
                                dynamics::Workspace& ws, const ConstVectorRef& q,
                                const ConstVectorRef& v) {
  by_q.setZero();
  by_v.setZero();
  force.setZero();
  if (channels.held_torque.size() > 0) force += channels.held_torque;
  for (Index i = 0; i < channels.damping.size(); ++i) {
    force[i] -= channels.damping[i] * v[i];
    by_v(i, i) -= channels.damping[i];
  }
  for (Index i = 0; i < channels.coulomb.size(); ++i) {
    const double t = std::tanh(v[i] / channels.coulomb_speed);
    force[i] -= channels.coulomb[i] * t;
    by_v(i, i) -= channels.coulomb[i] / channels.coulomb_speed * (1.0 - t * t);
  }
  if (!channels.wrenches.empty()) {
    dynamics::external_torque(model, ws, q, channels.wrenches, torque_);
    force += torque_;
    dynamics::external_torque_derivative(model, ws, q, channels.wrenches, slope_);
    by_q += slope_;
  }
  if (channels.gyroscopic.empty()) return;
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

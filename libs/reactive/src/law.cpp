#include "hamelin/reactive/law.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace hamelin::reactive {

namespace {

using Eigen::Vector3d;

// The length ℓ [m] that makes a rotation by one radian comparable with a displacement.
constexpr double rotation_length = 0.25;
// Damping of (J Jᵀ)⁻¹ relative to the trace of J Jᵀ: bounds joint speeds near singular postures.
constexpr double relative_damping = 0.004, projection_damping = 1e-7;
constexpr double passing_distance = 0.02;  // passed vias keep full speed beyond it
// Distances from the goal between which margins shrink: joint space [rad or m], tip [m].
constexpr double joint_near = 0.25, joint_far = 1.0, tip_near_m = 0.02, tip_far_m = 0.12;
constexpr double via_gain = 4.0;       // near a via [1/s]
constexpr double centring_gain = 0.3;  // towards the middle of the limits, in the null space [1/s]

}  // namespace

Law::Law(const planning::Setup& setup, const model::Model& model, const LawParams& params)
    : params_(params), J_(6, model.dof()), centring_(model.dof()), scratch_(model.dof()) {
  const auto lower = setup.q_lower(), upper = setup.q_upper();
  if (lower && upper && lower->allFinite() && upper->allFinite()) middle_ = 0.5 * (*lower + *upper);
}

TipError tip_error(const model::Model& model, const dynamics::Workspace& ws,
                   const hamelin_goal& goal) {
  const geometry::SE3 tip = dynamics::tip_pose(model, ws);
  TipError error{planning::vec3(goal.position_world_m) - tip.p(), Vector3d::Zero()};
  if (!rotates(goal)) return error;
  const auto& q = goal.quaternion_wxyz;
  const Eigen::AngleAxisd turn(Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix() *
                               tip.R().transpose());
  error.rotation = turn.axis() * turn.angle();
  return error;
}

double Law::distance(const model::Model& model, const dynamics::Workspace& ws,
                     const Eigen::VectorXd& q, const Target& target) {
  if (target.via != nullptr) return (*target.via - q).norm();
  if (target.goal->type == HAMELIN_GOAL_JOINT)
    return (planning::ConstVectorMap(target.goal->q, q.size()) - q).norm();
  const auto [position, rotation] = tip_error(model, ws, *target.goal);
  return 2.0 * position.norm() + 0.5 * rotation.norm();
}

bool Law::within(const model::Model& model, const dynamics::Workspace& ws, const Eigen::VectorXd& q,
                 const hamelin_goal& goal, double share) const {
  if (goal.type == HAMELIN_GOAL_JOINT)
    return (planning::ConstVectorMap(goal.q, q.size()) - q).lpNorm<Eigen::Infinity>() <
           share * goal.tolerance_rad;
  const auto [position, rotation] = tip_error(model, ws, goal);
  return position.norm() < share * goal.tolerance_m &&
         (!rotates(goal) || rotation.norm() < share * goal.tolerance_rad);
}

double Law::margin_weight(const model::Model& model, const dynamics::Workspace& ws,
                          const Eigen::VectorXd& q, const hamelin_goal& goal) const {
  if (goal.type == HAMELIN_GOAL_JOINT) {
    const double error = (planning::ConstVectorMap(goal.q, q.size()) - q).norm();
    return std::clamp((error - joint_near) / (joint_far - joint_near), 0.0, 1.0);
  }
  const double error =
      (planning::vec3(goal.position_world_m) - dynamics::tip_pose(model, ws).p()).norm();
  return std::clamp((error - tip_near_m) / (tip_far_m - tip_near_m), 0.0, 1.0);
}

double Law::attract(const model::Model& model, const dynamics::Workspace& ws,
                    const Eigen::VectorXd& q, const Target& target, Eigen::VectorXd& u) {
  if (target.via != nullptr || target.goal->type == HAMELIN_GOAL_JOINT) {
    if (target.via != nullptr)
      u = *target.via - q;
    else
      u = planning::ConstVectorMap(target.goal->q, q.size()) - q;
    const double error = u.lpNorm<Eigen::Infinity>();
    if (target.passing)
      u *= params_.cruise_speed / std::max(error, passing_distance);
    else if (error > 0.0)
      u *= std::min(target.via != nullptr ? via_gain : params_.joint_gain,
                    params_.cruise_speed / error);
    return u.norm();
  }
  const auto [position, rotation] = tip_error(model, ws, *target.goal);
  dynamics::frame_jacobian(model, ws, model.robot().tip.link, dynamics::tip_pose(model, ws).p(),
                           J_);
  Eigen::Matrix<double, 6, 1> desired = Eigen::Matrix<double, 6, 1>::Zero();
  if (rotates(*target.goal)) {
    J_.topRows<3>() *= rotation_length;
    const double angle = rotation.norm();
    if (angle > 0.0)
      desired.head<3>() =
          rotation_length * rotation * std::min(params_.tip_gain, params_.tip_turn / angle);
  } else {
    J_.topRows<3>().setZero();
  }
  const double error = position.norm();
  if (error > 0.0)
    desired.tail<3>() = position * std::min(params_.tip_gain, params_.tip_speed / error);
  const double rate =
      2.0 * desired.tail<3>().norm() + 0.5 / rotation_length * desired.head<3>().norm();
  inverse_.factor_relative(J_, relative_damping, 1e-6);
  inverse_.apply(J_, desired, u);
  const double fastest = u.lpNorm<Eigen::Infinity>();
  if (fastest > params_.cruise_speed) u *= params_.cruise_speed / fastest;
  if (middle_.size() == 0) return rate;
  centring_ = centring_gain * (middle_ - q);
  // Centring must not push the tip off its goal, so this projection is almost undamped.
  inverse_.damp_relative(projection_damping);
  const Eigen::Matrix<double, 6, 1> tip_motion = J_ * centring_;
  inverse_.apply(J_, tip_motion, scratch_);
  u += centring_ - scratch_;
  return rate;
}

void Law::repel(std::span<const NearPoint> points, double strength, Eigen::VectorXd& u) const {
  for (const auto& point : points) {
    const double h = std::max(point.distance - point.margin, 0.0);
    if (h >= params_.repulsion_range) continue;
    u += (strength * params_.repulsion_speed * (1.0 - h / params_.repulsion_range) /
          std::max(0.05, point.row.squaredNorm())) *
         point.row;
  }
}

}  // namespace hamelin::reactive

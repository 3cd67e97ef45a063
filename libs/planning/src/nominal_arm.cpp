#include "hamelin/planning/nominal_arm.hpp"

namespace hamelin::planning {

NominalArm::NominalArm(const Setup& setup) : model_(setup.model()), ws_(model_) {
  const Eigen::Index n = model_.dof();
  for (auto* x : {&q_, &v_, &joint_in_, &joint_out_}) x->setZero(n);
  J_.setZero(3, n);
  dynamics::forward_kinematics(model_, ws_, q_);
}

void NominalArm::update(const Tick& tick) {
  q_ = tick.q();
  v_ = tick.v();
  dynamics::forward_kinematics(model_, ws_, q_);
}

Eigen::Vector3d NominalArm::tip_position() const {
  return dynamics::tip_pose(model_, ws_).p();
}

Eigen::Vector3d NominalArm::point_velocity(int link, const Eigen::Vector3d& point) const {
  return dynamics::point_velocity(model_, ws_, link, point, v_);
}

Eigen::Vector3d NominalArm::in_link(int link, const Eigen::Vector3d& point) const {
  const geometry::SE3 pose = dynamics::link_pose(model_, ws_, link);
  return pose.R().transpose() * (point - pose.p());
}

Eigen::Matrix3d NominalArm::operational_inertia(int link, const Eigen::Vector3d& point) {
  dynamics::point_jacobian(model_, ws_, link, point, J_);
  return dynamics::operational_inertia(model_, ws_, q_, J_);
}

void NominalArm::add_force(int link, const Eigen::Vector3d& point, const Eigen::Vector3d& force,
                           Eigen::VectorXd& tau) {
  dynamics::point_jacobian_transpose(model_, ws_, link, point, force, joint_out_);
  tau += joint_out_;
}

void NominalArm::add_mapped(int link, const Eigen::Vector3d& point, const Eigen::Vector3d& f,
                            Eigen::VectorXd& tau) {
  add_force(link, point, operational_inertia(link, point) * f, tau);
}

void NominalArm::add_mapped_attraction(const hamelin_goal& goal, double k_p, double k_v,
                                       Eigen::VectorXd& tau) {
  if (goal.type == HAMELIN_GOAL_JOINT) {
    joint_in_ = -k_p * (q_ - ConstVectorMap(goal.q, q_.size())) - k_v * v_;
    dynamics::momentum(model_, ws_, q_, joint_in_, joint_out_);
    tau += joint_out_;
    return;
  }
  const Eigen::Vector3d tip = tip_position();
  const Eigen::Vector3d f =
      -k_p * (tip - vec3(goal.position_world_m)) - k_v * point_velocity(tip_link(), tip);
  add_mapped(tip_link(), tip, f, tau);
}

void NominalArm::add_gravity(Eigen::VectorXd& tau) {
  dynamics::gravity_torque(model_, ws_, q_, joint_out_);
  tau += joint_out_;
}

}  // namespace hamelin::planning

#include "channel_forces.hpp"

#include "kernel_arguments.hpp"

namespace hamelin::integration {

ChannelForces::ChannelForces(const Model& model, WrenchForces& wrenches)
    : model_(model), wrenches_(wrenches), total_(VectorXd::Zero(model.dof())) {
  for (Part* part : parts_) part->force = total_;
}

void ChannelForces::sum(const Channels& channels, dynamics::Workspace& ws, const VectorXd& q,
                        const VectorXd& v) {
  any_ = !channels.none();
  if ((held_.active = channels.held_torque.size() > 0)) held_.force = channels.held_torque;
  const kernel::Forces of_joints = joint_forces(channels);
  damping_.active = of_joints.damping != nullptr;
  coulomb_.active = of_joints.coulomb != nullptr;
  for (Eigen::Index i = 0; i < v.size(); ++i) {
    const auto joint = static_cast<std::size_t>(i);
    if (damping_.active) damping_.force[i] = kernel::damping_of(of_joints, joint, v[i]);
    if (coulomb_.active) coulomb_.force[i] = kernel::dry_friction(of_joints, joint, v[i]);
  }
  if ((gyroscopic_.active = !channels.gyroscopic.empty()))
    dynamics::gyroscopic_torque(model_, ws, q, v, channels.gyroscopic, gyroscopic_.force);
  if ((external_.active = !channels.wrenches.empty())) external_.force = wrenches_.evaluate(q, v);
  total_.setZero();
  for (const Part* part : parts_)
    if (part->active) total_ += part->sign * part->force;
}

void ChannelForces::sum_work(StepReport& report, const VectorXd& displacement,
                             double weight) const {
  for (const Part* part : parts_)
    if (part->active) report.*part->account += weight * part->force.dot(displacement);
}

}  // namespace hamelin::integration

#include "channel_forces.hpp"

namespace hamelin::integration {

ChannelForces::ChannelForces(const Model& model, WrenchForces& wrenches)
    : model_(model), wrenches_(wrenches), total_(VectorXd::Zero(model.dof())) {
  for (Part* part : parts_) part->force = total_;
}

void ChannelForces::sum(const Channels& channels, dynamics::Workspace& ws, const VectorXd& q,
                        const VectorXd& v) {
  any_ = !channels.none();
  if ((held_.active = channels.held_torque.size() > 0)) held_.force = channels.held_torque;
  if ((damping_.active = channels.damping.size() > 0))
    damping_.force = channels.damping.cwiseProduct(v);
  if ((coulomb_.active = channels.coulomb.size() > 0))
    coulomb_.force =
        channels.coulomb.cwiseProduct((v / channels.coulomb_speed).array().tanh().matrix());
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

// These headers need fewer packages than <dart/dart.hpp>.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#include <dart/config.hpp>
#include <dart/dynamics/BodyNode.hpp>
#include <dart/dynamics/PrismaticJoint.hpp>
#include <dart/dynamics/RevoluteJoint.hpp>
#include <dart/dynamics/Skeleton.hpp>
#pragma GCC diagnostic pop

#include <cmath>

#include "peer.hpp"

namespace hamelin::peers {

namespace {

using dart::dynamics::BodyNode;
using dart::dynamics::SkeletonPtr;

template <class JointType>
BodyNode* add_link(const SkeletonPtr& skeleton, BodyNode* parent, const model::Robot& robot,
                   int i) {
  const auto& link = robot.links[static_cast<std::size_t>(i)];
  typename JointType::Properties joint;
  joint.mName = link.joint.name;
  joint.mAxis = joint_axis(link.joint);
  joint.mT_ParentBodyToJoint.translation() = joint_origin(robot, i) - joint_origin(robot, i - 1);
  BodyNode::Properties body;
  body.mName = link.name;
  body.mInertia = dart::dynamics::Inertia(link.mass_kg, link.com.p() - joint_origin(robot, i),
                                          inertia_in_base_axes(link));
  return skeleton->createJointAndBodyNodePair<JointType>(parent, joint, body).second;
}

SkeletonPtr make_skeleton(const model::Robot& robot) {
  const SkeletonPtr skeleton = dart::dynamics::Skeleton::create(robot.name);
  BodyNode* parent = nullptr;
  for (int i = 0; i < robot.dof(); ++i)
    parent = robot.links[static_cast<std::size_t>(i)].joint.type == model::JointType::prismatic
                 ? add_link<dart::dynamics::PrismaticJoint>(skeleton, parent, robot, i)
                 : add_link<dart::dynamics::RevoluteJoint>(skeleton, parent, robot, i);
  skeleton->setGravity(Eigen::Vector3d(0.0, 0.0, -9.81));
  return skeleton;
}

// Does what World::step does with a skeleton that has no contacts.
class DartStepper final : public Stepper {
 public:
  explicit DartStepper(const model::Robot& robot) : skeleton_(make_skeleton(robot)) {}
  void set(const VectorXd& q, const VectorXd& v) override {
    skeleton_->setPositions(q);
    skeleton_->setVelocities(v);
  }
  bool step(double h) override {
    skeleton_->setTimeStep(h);
    skeleton_->computeForwardDynamics();
    skeleton_->integrateVelocities(h);
    // with larger velocities an assertion inside DART fails
    constexpr double velocity_max = 1e6;
    for (std::size_t i = 0; i < skeleton_->getNumDofs(); ++i)
      if (!(std::abs(skeleton_->getVelocity(i)) < velocity_max)) return false;
    skeleton_->integratePositions(h);
    return true;
  }
  void get(VectorXd& q, VectorXd& v) override {
    q = skeleton_->getPositions();
    v = skeleton_->getVelocities();
  }

 private:
  SkeletonPtr skeleton_;
};

class Dart final : public Peer {
 public:
  explicit Dart(const model::Robot& robot) : robot_(robot), skeleton_(make_skeleton(robot)) {}
  [[nodiscard]] std::string name() const override { return "DART " DART_VERSION; }
  void inverse_dynamics(const VectorXd& q, const VectorXd& v, const VectorXd& a,
                        VectorXd& tau) override {
    skeleton_->setPositions(q);
    skeleton_->setVelocities(v);
    skeleton_->setAccelerations(a);
    skeleton_->computeInverseDynamics();
    tau = skeleton_->getForces();
  }
  void forward_dynamics(const VectorXd& q, const VectorXd& v, const VectorXd& tau,
                        VectorXd& a) override {
    skeleton_->setPositions(q);
    skeleton_->setVelocities(v);
    skeleton_->setForces(tau);
    skeleton_->computeForwardDynamics();
    a = skeleton_->getAccelerations();
  }
  [[nodiscard]] std::vector<std::string> steppers() const override { return {"semi-implicit"}; }
  [[nodiscard]] std::unique_ptr<Stepper> stepper(const std::string&) override {
    return std::make_unique<DartStepper>(robot_);
  }

 private:
  model::Robot robot_;
  SkeletonPtr skeleton_;
};

}  // namespace

std::unique_ptr<Peer> make_dart(const model::Robot& robot) {
  return std::make_unique<Dart>(robot);
}

}  // namespace hamelin::peers

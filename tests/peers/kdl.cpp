#include <kdl/chain.hpp>
#include <kdl/chainfdsolver_recursive_newton_euler.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>
#include <stdexcept>

#include "peer.hpp"

namespace hamelin::peers {

namespace {

KDL::Vector to_kdl(const Eigen::Vector3d& x) {
  return {x.x(), x.y(), x.z()};
}

KDL::Chain make_chain(const model::Robot& robot) {
  KDL::Chain chain;
  for (int i = 0; i < robot.dof(); ++i) {
    const auto& link = robot.links[static_cast<std::size_t>(i)];
    const KDL::Vector at = to_kdl(joint_origin(robot, i) - joint_origin(robot, i - 1));
    const auto type = link.joint.type == model::JointType::prismatic ? KDL::Joint::TransAxis
                                                                     : KDL::Joint::RotAxis;
    const Eigen::Matrix3d I = inertia_in_base_axes(link);
    chain.addSegment(KDL::Segment(
        link.name, KDL::Joint(link.joint.name, at, to_kdl(joint_axis(link.joint)), type),
        KDL::Frame(at),
        KDL::RigidBodyInertia(
            link.mass_kg, to_kdl(link.com.p() - joint_origin(robot, i)),
            KDL::RotationalInertia(I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2)))));
  }
  return chain;
}

class Kdl final : public Peer {
 public:
  explicit Kdl(const model::Robot& robot)
      : chain_(make_chain(robot)),
        inverse_(chain_, {0.0, 0.0, -9.81}),
        forward_(chain_, {0.0, 0.0, -9.81}),
        forces_(chain_.getNrOfSegments(), KDL::Wrench::Zero()) {
    const auto n = static_cast<unsigned>(robot.dof());
    for (auto* x : {&q_, &v_, &a_, &tau_}) x->resize(n);
  }
  [[nodiscard]] std::string name() const override { return "KDL"; }
  void inverse_dynamics(const VectorXd& q, const VectorXd& v, const VectorXd& a,
                        VectorXd& tau) override {
    q_.data = q;
    v_.data = v;
    a_.data = a;
    if (inverse_.CartToJnt(q_, v_, a_, forces_, tau_) < 0)
      throw std::runtime_error("KDL: inverse dynamics failed");
    tau = tau_.data;
  }
  void forward_dynamics(const VectorXd& q, const VectorXd& v, const VectorXd& tau,
                        VectorXd& a) override {
    q_.data = q;
    v_.data = v;
    tau_.data = tau;
    if (forward_.CartToJnt(q_, v_, tau_, forces_, a_) < 0)
      throw std::runtime_error("KDL: forward dynamics failed");
    a = a_.data;
  }

 private:
  KDL::Chain chain_;
  KDL::ChainIdSolver_RNE inverse_;
  KDL::ChainFdSolver_RNE forward_;
  std::vector<KDL::Wrench> forces_;
  KDL::JntArray q_, v_, a_, tau_;
};

}  // namespace

std::unique_ptr<Peer> make_kdl(const model::Robot& robot) {
  return std::make_unique<Kdl>(robot);
}

}  // namespace hamelin::peers

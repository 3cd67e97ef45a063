#include <fmt/format.h>

#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/config.hpp>
#include <pinocchio/multibody/data.hpp>
#include <pinocchio/multibody/joint/joint-generic.hpp>
#include <pinocchio/multibody/model.hpp>

#include "peer.hpp"

namespace hamelin::peers {

namespace {

pinocchio::Model make_model(const model::Robot& robot) {
  pinocchio::Model out;
  pinocchio::JointIndex parent = 0;
  for (int i = 0; i < robot.dof(); ++i) {
    const auto& link = robot.links[static_cast<std::size_t>(i)];
    const Eigen::Vector3d at = joint_origin(robot, i) - joint_origin(robot, i - 1);
    const pinocchio::SE3 placement(Eigen::Matrix3d::Identity(), at);
    const Eigen::Vector3d axis = joint_axis(link.joint);
    if (link.joint.type == model::JointType::prismatic)
      parent = out.addJoint(parent, pinocchio::JointModelPrismaticUnaligned(axis), placement,
                            link.joint.name);
    else
      parent = out.addJoint(parent, pinocchio::JointModelRevoluteUnaligned(axis), placement,
                            link.joint.name);
    out.appendBodyToJoint(
        parent, {link.mass_kg, link.com.p() - joint_origin(robot, i), inertia_in_base_axes(link)});
  }
  out.gravity.linear() << 0.0, 0.0, -9.81;
  return out;
}

class Pinocchio final : public Peer {
 public:
  explicit Pinocchio(const model::Robot& robot) : model_(make_model(robot)), data_(model_) {}
  [[nodiscard]] std::string name() const override {
    return fmt::format("Pinocchio {}", PINOCCHIO_VERSION);
  }
  [[nodiscard]] std::string instruction_set() const override {
#ifdef PINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION
    return "as packaged";
#else
    return "baseline, compiled here";
#endif
  }
  void inverse_dynamics(const VectorXd& q, const VectorXd& v, const VectorXd& a,
                        VectorXd& tau) override {
    tau = pinocchio::rnea(model_, data_, q, v, a);
  }
  void forward_dynamics(const VectorXd& q, const VectorXd& v, const VectorXd& tau,
                        VectorXd& a) override {
    a = pinocchio::aba(model_, data_, q, v, tau);
  }

 private:
  pinocchio::Model model_;
  pinocchio::Data data_;
};

}  // namespace

std::unique_ptr<Peer> make_pinocchio(const model::Robot& robot) {
  return std::make_unique<Pinocchio>(robot);
}

}  // namespace hamelin::peers

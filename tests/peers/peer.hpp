#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "hamelin/model/robot.hpp"

/// Common interface of all dynamics programs. A robot is given in hamelin's form: screws and poses
/// of the centres of mass (COM) in the base frame at q = 0. Gravity is (0, 0, −9.81) m/s². All
/// joint vectors have one number per joint.
namespace hamelin::peers {

using Eigen::VectorXd;

/// A scheme with a fixed step.
class Stepper {
 public:
  virtual ~Stepper() = default;
  virtual void set(const VectorXd& q, const VectorXd& v) = 0;
  /// @returns false if the step failed
  virtual bool step(double h) = 0;
  virtual void get(VectorXd& q, VectorXd& v) = 0;
};

/// A dynamics program with a robot.
class Peer {
 public:
  virtual ~Peer() = default;
  [[nodiscard]] virtual std::string name() const = 0;
  /// The instruction set of its code: that of the flags of this build for what is compiled here,
  /// which are those of the baseline; that of a package is its packager's choice.
  [[nodiscard]] virtual std::string instruction_set() const { return "as packaged"; }
  virtual void inverse_dynamics(const VectorXd& q, const VectorXd& v, const VectorXd& a,
                                VectorXd& tau) = 0;
  virtual void forward_dynamics(const VectorXd& q, const VectorXd& v, const VectorXd& tau,
                                VectorXd& a) = 0;
  /// Names of its steppers; empty if it only computes dynamics.
  [[nodiscard]] virtual std::vector<std::string> steppers() const { return {}; }
  [[nodiscard]] virtual std::unique_ptr<Stepper> stepper(const std::string&) { return nullptr; }
};

/// Point on the axis of a link's joint, in the base frame at q = 0: for revolute joints the one
/// nearest to the base, for prismatic joints the COM. It is the origin of the link's frame, whose
/// axes are those of the base. The base's origin for a negative index.
inline Eigen::Vector3d joint_origin(const model::Robot& robot, int link) {
  if (link < 0) return Eigen::Vector3d::Zero();
  const auto& l = robot.links[static_cast<std::size_t>(link)];
  if (l.joint.type == model::JointType::prismatic) return l.com.p();
  const Eigen::Vector3d omega = l.joint.screw.head<3>(), v = l.joint.screw.tail<3>();
  return omega.cross(v);
}

/// Axis of a joint in the base frame at q = 0.
inline Eigen::Vector3d joint_axis(const model::Joint& joint) {
  return joint.type == model::JointType::prismatic ? Eigen::Vector3d(joint.screw.tail<3>())
                                                   : Eigen::Vector3d(joint.screw.head<3>());
}

/// Inertia about the COM, with the axes of the base frame at q = 0.
inline Eigen::Matrix3d inertia_in_base_axes(const model::Link& link) {
  return link.com.R() * link.inertia_kg_m2 * link.com.R().transpose();
}

[[nodiscard]] std::unique_ptr<Peer> make_ours(const model::Robot& robot);
/// Null for chains that are too long for MuJoCo's reader.
[[nodiscard]] std::unique_ptr<Peer> make_mujoco(const model::Robot& robot);
[[nodiscard]] std::unique_ptr<Peer> make_dart(const model::Robot& robot);
[[nodiscard]] std::unique_ptr<Peer> make_kdl(const model::Robot& robot);
[[nodiscard]] std::unique_ptr<Peer> make_pinocchio(const model::Robot& robot);

/// hamelin first, then each peer that was found when this program was built.
[[nodiscard]] inline std::vector<std::unique_ptr<Peer>> make_all(const model::Robot& robot) {
  std::vector<std::unique_ptr<Peer>> all;
  all.push_back(make_ours(robot));
#ifdef HAMELIN_WITH_MUJOCO
  if (auto mujoco = make_mujoco(robot)) all.push_back(std::move(mujoco));
#endif
#ifdef HAMELIN_WITH_DART
  all.push_back(make_dart(robot));
#endif
#ifdef HAMELIN_WITH_PINOCCHIO
  all.push_back(make_pinocchio(robot));
#endif
#ifdef HAMELIN_WITH_KDL
  all.push_back(make_kdl(robot));
#endif
  return all;
}

}  // namespace hamelin::peers

#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "hamelin/model/robot.hpp"

/// What is asked of every dynamics program alike. A robot comes in hamelin's form: screws and COM poses in the base
/// frame at q = 0; gravity is (0, 0, −9.81) m/s². All joint vectors have dof numbers.
namespace hamelin::peers {

using Eigen::VectorXd;

/// A way of taking a step of fixed length.
class Stepper {
 public:
  virtual ~Stepper() = default;
  virtual void set(const VectorXd& q, const VectorXd& v) = 0;
  /// @returns false where no step could be taken
  virtual bool step(double h) = 0;
  virtual void get(VectorXd& q, VectorXd& v) = 0;
};

class Peer {
 public:
  virtual ~Peer() = default;
  [[nodiscard]] virtual std::string name() const = 0;
  virtual void inverse_dynamics(const VectorXd& q, const VectorXd& v, const VectorXd& a, VectorXd& tau) = 0;
  virtual void forward_dynamics(const VectorXd& q, const VectorXd& v, const VectorXd& tau, VectorXd& a) = 0;
  /// Names of its steppers; none where it only computes dynamics.
  [[nodiscard]] virtual std::vector<std::string> steppers() const { return {}; }
  [[nodiscard]] virtual std::unique_ptr<Stepper> stepper(const std::string&) { return nullptr; }
};

/// Joint origin of link i in base axes, seen from the one of the link before: all frames stand as the base does.
inline Eigen::Vector3d joint_origin(const model::Robot& robot, int link) {
  if (link < 0) return Eigen::Vector3d::Zero();
  const auto& l = robot.links[static_cast<std::size_t>(link)];
  if (l.joint.type == model::JointType::prismatic) return l.com.p();
  const Eigen::Vector3d omega = l.joint.screw.head<3>(), v = l.joint.screw.tail<3>();
  return omega.cross(v);  // the axis' point nearest to the base
}

/// Moving axis in base axes.
inline Eigen::Vector3d joint_axis(const model::Joint& joint) {
  return joint.type == model::JointType::prismatic ? Eigen::Vector3d(joint.screw.tail<3>())
                                                   : Eigen::Vector3d(joint.screw.head<3>());
}

/// Inertia about the COM in base axes at q = 0.
inline Eigen::Matrix3d inertia_in_base_axes(const model::Link& link) {
  return link.com.R() * link.inertia_kg_m2 * link.com.R().transpose();
}

[[nodiscard]] std::unique_ptr<Peer> make_ours(const model::Robot& robot);
/// Null for chains longer than it can read.
[[nodiscard]] std::unique_ptr<Peer> make_mujoco(const model::Robot& robot);
[[nodiscard]] std::unique_ptr<Peer> make_dart(const model::Robot& robot);
[[nodiscard]] std::unique_ptr<Peer> make_kdl(const model::Robot& robot);

/// Ours first, then each peer that was there when this was built.
[[nodiscard]] inline std::vector<std::unique_ptr<Peer>> make_all(const model::Robot& robot) {
  std::vector<std::unique_ptr<Peer>> all;
  all.push_back(make_ours(robot));
#ifdef HAMELIN_WITH_MUJOCO
  if (auto mujoco = make_mujoco(robot)) all.push_back(std::move(mujoco));
#endif
#ifdef HAMELIN_WITH_DART
  all.push_back(make_dart(robot));
#endif
#ifdef HAMELIN_WITH_KDL
  all.push_back(make_kdl(robot));
#endif
  return all;
}

}  // namespace hamelin::peers

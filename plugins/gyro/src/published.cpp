#include "published.hpp"

#include <Eigen/Geometry>

namespace hamelin::gyro {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using namespace planning;

Published::Published(const Setup& setup, const Json& params)
    : setup_(setup),
      arm_(setup),
      turning_(arm_.model(), params),
      k_p_(params.at("k_p").get<double>()),
      k_v_(params.at("k_v").get<double>()),
      joint_damping_(params.at("joint_damping").get<double>()),
      keep_attraction_(params.at("algorithm") == "keep_attraction"),
      gravity_compensation_(params.at("gravity_compensation").get<bool>()),
      tau_(setup.dof()) {}

void Published::tick(const Tick& tick, Command& command) {
  arm_.update(tick);
  command.damping().setConstant(joint_damping_);
  tau_.setZero();
  bool steering = false;
  for_each_nearest(
      tick.contacts(), setup_.shapes(), turning_.range_m(),
      [&](const hamelin_contact& c, int link) {
        const Vector3d point = vec3(c.arm_point_world_m), to_obstacle = -vec3(c.direction_world);
        const Vector3d velocity = arm_.point_velocity(link, point);
        if (!(to_obstacle.dot(velocity) > 0.0)) return;
        steering = true;
        const Vector3d heading = velocity / velocity.stableNorm();  // the squares may underflow
        const Vector3d e = turning_.rate(c.distance_m, to_obstacle, heading);
        const Matrix3d M_x = arm_.operational_inertia(link, point);
        if (turning_.variant() == Variant::published)  // docs/theory.md (9.12)
          arm_.add_force(link, point, M_x * e.cross(velocity), tau_);
        else
          command.add_gyroscopic(link, arm_.in_link(link, point), Turning::neutral(M_x, e));
      });
  if (!steering || keep_attraction_)  // Algorithm II of Shen, Wang, Shi (2021)
    arm_.add_mapped_attraction(tick.goal(), k_p_ * tick.speed_scale(), k_v_, tau_);
  if (gravity_compensation_) arm_.add_gravity(tau_);
  command.held_torque() = tau_;
}

}  // namespace hamelin::gyro

#pragma once
#include <Eigen/Core>
#include <span>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"

namespace hamelin::planning {

/// The arm as the planner believes it to be, at one tick: what planners that work with forces at points share. Made
/// once; nothing allocates afterwards. Points, forces and velocities in world axes.
class NominalArm {
 public:
  explicit NominalArm(const Setup& setup);

  /// Takes q and v of a tick; all below speaks of them.
  void update(const Tick& tick);

  [[nodiscard]] const model::Model& model() const noexcept { return model_; }
  [[nodiscard]] dynamics::Workspace& workspace() noexcept { return ws_; }
  [[nodiscard]] const Eigen::VectorXd& q() const noexcept { return q_; }
  [[nodiscard]] const Eigen::VectorXd& v() const noexcept { return v_; }

  [[nodiscard]] int tip_link() const noexcept { return model_.robot().tip.link; }
  [[nodiscard]] Eigen::Vector3d tip_position() const;
  /// Velocity of a world point that moves with the link [m/s].
  [[nodiscard]] Eigen::Vector3d point_velocity(int link, const Eigen::Vector3d& point) const;
  /// A world point in the link's COM frame.
  [[nodiscard]] Eigen::Vector3d in_link(int link, const Eigen::Vector3d& point) const;
  /// Damped operational-space inertia M_x at a world point of the link (21) [kg].
  [[nodiscard]] Eigen::Matrix3d operational_inertia(int link, const Eigen::Vector3d& point);

  /// tau += Jᵀ f for a force at a world point of the link.
  void add_force(int link, const Eigen::Vector3d& point, const Eigen::Vector3d& force, Eigen::VectorXd& tau);
  /// tau += Jᵀ M_x f (21): f is then an acceleration of the point [m/s²].
  void add_mapped(int link, const Eigen::Vector3d& point, const Eigen::Vector3d& f, Eigen::VectorXd& tau);
  /// The attraction (17), mapped by (21): f = −k_p (x_e − x_d) − k_v ẋ_e at the tip; for a joint goal its likeness in
  /// joint space, tau += M(q)(−k_p (q − q_d) − k_v v). A pose goal pulls by its position only.
  /// @param k_p [1/s²]  @param k_v [1/s]
  void add_mapped_attraction(const hamelin_goal& goal, double k_p, double k_v, Eigen::VectorXd& tau);
  /// tau += ∂U(q): holds the nominal arm against gravity.
  void add_gravity(Eigen::VectorXd& tau);

 private:
  model::Model model_;
  dynamics::Workspace ws_;
  Eigen::VectorXd q_, v_, joint_in_, joint_out_;
  dynamics::Matrix3Xd J_;
};

/// Calls f(contact, link) for the nearest contact of each link with each obstacle (the map counts as one, unknown space
/// that blocks as another) within `range`: the x_i of (18). Equal distances: the first. Contacts as a tick lists them.
template <class F>
void for_each_nearest(std::span<const hamelin_contact> contacts, std::span<const hamelin_sphere> spheres, double range,
                      F&& f) {
  const auto link_of = [&](std::size_t i) { return spheres[static_cast<std::size_t>(contacts[i].sphere)].link; };
  for (std::size_t begin = 0, end = 0; begin < contacts.size(); begin = end) {
    const auto link = link_of(begin);
    while (end < contacts.size() && link_of(end) == link) ++end;
    for (std::size_t i = begin; i < end; ++i) {
      if (contacts[i].distance_m > range) continue;
      bool nearest = true;
      for (std::size_t j = begin; j < end && nearest; ++j) {
        nearest = contacts[j].obstacle != contacts[i].obstacle || contacts[j].distance_m > contacts[i].distance_m ||
                  (contacts[j].distance_m == contacts[i].distance_m && j >= i);
      }
      if (nearest) f(contacts[i], link);
    }
  }
}

}  // namespace hamelin::planning

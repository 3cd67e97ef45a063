#pragma once
#include <Eigen/Core>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"

namespace hamelin::planning {

/// The nominal arm at one tick, for planners that work with forces at points. All memory is
/// allocated by the constructor. Points, forces and velocities are in world axes.
class NominalArm {
 public:
  explicit NominalArm(const Setup& setup);

  /// Takes q and v of a tick. All functions below refer to them.
  void update(const Tick& tick);

  [[nodiscard]] const model::Model& model() const noexcept { return model_; }
  [[nodiscard]] dynamics::Workspace& workspace() noexcept { return ws_; }
  [[nodiscard]] const Eigen::VectorXd& q() const noexcept { return q_; }
  [[nodiscard]] const Eigen::VectorXd& v() const noexcept { return v_; }

  [[nodiscard]] int tip_link() const noexcept { return model_.robot().tip.link; }
  [[nodiscard]] Eigen::Vector3d tip_position() const;
  /// Velocity of a world point that moves with the link [m/s].
  [[nodiscard]] Eigen::Vector3d point_velocity(int link, const Eigen::Vector3d& point) const;
  /// The coordinates of a world point in the link's COM frame [m].
  [[nodiscard]] Eigen::Vector3d in_link(int link, const Eigen::Vector3d& point) const;
  /// Damped operational-space inertia M_x [kg] at a world point of the link, docs/theory.md (2.21).
  [[nodiscard]] Eigen::Matrix3d operational_inertia(int link, const Eigen::Vector3d& point);

  /// tau += Jᵀ f for a force f [N] at a world point of the link.
  void add_force(int link, const Eigen::Vector3d& point, const Eigen::Vector3d& force,
                 Eigen::VectorXd& tau);
  /// tau += Jᵀ M_x f, docs/theory.md (9.4). Here f is an acceleration of the point [m/s²].
  void add_mapped(int link, const Eigen::Vector3d& point, const Eigen::Vector3d& f,
                  Eigen::VectorXd& tau);
  /// Adds the attraction f = −k_p (x_e − x_d) − k_v ẋ_e of the tip x_e to the goal x_d, mapped to
  /// joints, docs/theory.md (9.1), (9.4). For a joint goal q_d it adds the corresponding law in
  /// joint space, tau += M(q) (−k_p (q − q_d) − k_v v), docs/theory.md (9.6). A pose goal attracts
  /// by its position only.
  /// @param k_p [1/s²] @param k_v [1/s]
  void add_mapped_attraction(const hamelin_goal& goal, double k_p, double k_v,
                             Eigen::VectorXd& tau);
  /// tau += ∂U(q): compensates the gravity of the nominal arm.
  void add_gravity(Eigen::VectorXd& tau);

 private:
  model::Model model_;
  dynamics::Workspace ws_;
  Eigen::VectorXd q_, v_, joint_in_, joint_out_;
  dynamics::Matrix3Xd J_;
};

/// Calls f(contact, link) for the nearest contact of each link with each obstacle within `range`
/// [m]: the points x_i of docs/theory.md (9.2). The map counts as one obstacle, unknown space that
/// blocks as another. Of equal distances the first counts.
/// @param contacts in the order in which a tick lists them
template <class F>
void for_each_nearest(const Contacts& contacts, const ControlShapes& shapes, double range, F&& f) {
  const auto link_of = [&](std::size_t i) {
    return shapes[static_cast<std::size_t>(contacts[i].shape)].link;
  };
  for (std::size_t begin = 0, end = 0; begin < contacts.size(); begin = end) {
    const auto link = link_of(begin);
    while (end < contacts.size() && link_of(end) == link) ++end;
    for (std::size_t i = begin; i < end; ++i) {
      if (contacts[i].distance_m > range) continue;
      bool nearest = true;
      for (std::size_t j = begin; j < end && nearest; ++j) {
        nearest = contacts[j].obstacle != contacts[i].obstacle ||
                  contacts[j].distance_m > contacts[i].distance_m ||
                  (contacts[j].distance_m == contacts[i].distance_m && j >= i);
      }
      if (nearest) f(contacts[i], link);
    }
  }
}

}  // namespace hamelin::planning

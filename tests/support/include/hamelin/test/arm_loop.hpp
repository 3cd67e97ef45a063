#pragma once
#include <fmt/format.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin_host.hpp"

/// A small closed loop for the tests of planners, independent of hamelin's simulation:
/// semi-implicit Euler, balls as obstacles, one goal.
namespace hamelin::test {

/// The arm of example 5.2 of Shen, Wang, Shi (2021), Table 1: unit links along x with joints about
/// z, centres of mass at their far ends, unit masses and inertias. Control spheres are placed side
/// by side along the links.
inline model::Robot planar4(int spheres = 25, double radius = 0.02) {
  model::Robot robot;
  robot.name = "planar4";
  for (int i = 0; i < 4; ++i) {
    model::Link link;
    link.name = fmt::format("link{}", i + 1);
    link.parent = i - 1;
    link.joint.name = fmt::format("j{}", i + 1);
    link.joint.screw << 0.0, 0.0, 1.0, 0.0, -static_cast<double>(i), 0.0;
    link.com = geometry::SE3{Eigen::Matrix3d::Identity(), Eigen::Vector3d{i + 1.0, 0.0, 0.0}};
    link.mass_kg = 1.0;
    link.inertia_kg_m2.setIdentity();
    for (int k = 0; k < spheres; ++k)
      link.spheres.push_back({Eigen::Vector3d{(k + 0.5) / spheres - 1.0, 0.0, 0.0}, radius});
    robot.links.push_back(link);
  }
  robot.tip = {"tip", 3,
               geometry::SE3{Eigen::Matrix3d::Identity(), Eigen::Vector3d{4.0, 0.0, 0.0}}};
  return robot;
}

struct Ball {
  Eigen::Vector3d center;
  double radius;
};

/// The outcome of a closed loop.
struct LoopResult {
  bool reached = false;  ///< tip within 0.02 m and 0.05 m/s
  double time_s = 0.0;   ///< of arrival, or else of the end
  double clearance_m = std::numeric_limits<double>::infinity();
  double distance_m = 0.0;         ///< of the tip from the goal at the end
  double speed_m_s = 0.0;          ///< of the tip at the end
  double gyroscopic_work_J = 0.0;  ///< Σ h |power| of the gyroscopic channel
};

class ArmLoop : public planning::HostServices {
 public:
  /// @param q_goal a joint goal, which replaces the tip's goal if it is not empty
  ArmLoop(const std::string& plugin_file, Json params, const model::Robot& robot,
          const Eigen::Vector3d& goal, std::vector<Ball> balls,
          const Eigen::Vector3d& gravity = Eigen::Vector3d::Zero(),
          const Eigen::VectorXd& q_goal = {})
      : model_(robot, geometry::SE3{}, gravity),
        ws_(model_),
        balls_(std::move(balls)),
        goal_(goal),
        q(Eigen::VectorXd::Zero(model_.dof())),
        v(Eigen::VectorXd::Zero(model_.dof())),
        buffers(static_cast<std::size_t>(model_.dof()), 4096) {
    const planning::Plugin plugin = planning::Plugin::load(plugin_file);
    params = planning::check_params(plugin, params);
    planning::SetupData setup(model_);
    influence_ = plugin.influence_m(params).value_or(0.5);
    setup.influence_m = influence_;
    setup.control_period_s = 0.004;
    target.struct_size = sizeof target;
    target.type = q_goal.size() > 0 ? HAMELIN_GOAL_JOINT : HAMELIN_GOAL_POSITION;
    std::copy_n(goal.data(), 3, target.position_world_m);
    setup.add_goal(target, q_goal);
    q_goal_ = q_goal;
    if (q_goal_.size() > 0) target.q = q_goal_.data();
    shapes_ = setup.shapes;
    contacts_.reserve(4096);
    planner_.emplace_back(plugin.create(std::move(setup), *this, params));
  }

  void log(std::int32_t, std::string_view) override {}
  std::size_t closest_points(std::span<const double>, double,
                             planning::ArrayOut<hamelin_contact>) override {
    return 0;
  }

  /// Contacts at q, listed as a host lists them.
  const std::vector<hamelin_contact>& contacts() {
    dynamics::forward_kinematics(model_, ws_, q);
    contacts_.clear();
    clearance = std::numeric_limits<double>::infinity();
    for (std::size_t s = 0; s < shapes_.size(); ++s) {
      const auto& sphere = shapes_[s];
      const Eigen::Vector3d center = dynamics::point_position(
          model_, ws_, sphere.link, Eigen::Map<const Eigen::Vector3d>(sphere.center_link_m));
      const std::size_t first = contacts_.size();
      for (std::size_t b = 0; b < balls_.size(); ++b) {
        const Eigen::Vector3d away = center - balls_[b].center, direction = away.normalized();
        hamelin_contact c{};
        c.shape = static_cast<std::int32_t>(s);
        c.obstacle = static_cast<std::int32_t>(b);
        c.distance_m = away.norm() - sphere.radius_m - balls_[b].radius;
        clearance = std::min(clearance, c.distance_m);
        if (c.distance_m > influence_) continue;
        Eigen::Map<Eigen::Vector3d>(c.arm_point_world_m) = center - sphere.radius_m * direction;
        Eigen::Map<Eigen::Vector3d>(c.obstacle_point_world_m) =
            balls_[b].center + balls_[b].radius * direction;
        Eigen::Map<Eigen::Vector3d>(c.direction_world) = direction;
        contacts_.push_back(c);
      }
      std::sort(contacts_.begin() + static_cast<std::ptrdiff_t>(first), contacts_.end(),
                [](const auto& a, const auto& b) { return a.distance_m < b.distance_m; });
    }
    return contacts_;
  }

  /// One call of the planner at (q, v); the answer is in `buffers`.
  bool tick() {
    const auto& near = contacts();
    hamelin_tick input{};
    input.struct_size = sizeof input;
    input.k = k_;
    input.time_s = 0.004 * static_cast<double>(k_);
    input.q = q.data();
    input.v = v.data();
    input.contacts = near.data();
    input.contact_count = near.size();
    input.contact_stride = sizeof(hamelin_contact);
    input.goal = &target;
    input.speed_scale = 1.0;
    return planner_.front().tick(input, buffers);
  }
  [[nodiscard]] std::string_view error() const { return planner_.front().error(); }

  /// Torque of the gyroscopic channel at velocity v.
  Eigen::VectorXd gyroscopic_torque() {
    Eigen::VectorXd tau = Eigen::VectorXd::Zero(model_.dof()), row = tau;
    dynamics::forward_kinematics(model_, ws_, q);
    for (const auto& term : buffers.gyroscopic()) {
      const Eigen::Vector3d at = dynamics::point_position(
          model_, ws_, term.link, Eigen::Map<const Eigen::Vector3d>(term.point_link_m));
      const Eigen::Vector3d velocity = dynamics::point_velocity(model_, ws_, term.link, at, v);
      const Eigen::Vector3d force = Eigen::Map<const Eigen::Vector3d>(term.w_world).cross(velocity);
      dynamics::point_jacobian_transpose(model_, ws_, term.link, at, force, row);
      tau += row;
    }
    return tau;
  }

  /// Semi-implicit Euler with steps of 4 ms until arrival or until the time is over.
  LoopResult run(double duration_s) {
    const double h = 0.004;
    LoopResult result;
    Eigen::VectorXd a(model_.dof()), tau(model_.dof());
    for (; h * static_cast<double>(k_) < duration_s; ++k_) {
      if (!tick()) throw std::runtime_error(std::string(error()));
      result.clearance_m = std::min(result.clearance_m, clearance);
      const Eigen::Vector3d tip = dynamics::tip_pose(model_, ws_).p();
      result.distance_m = (tip - goal_).norm();
      result.speed_m_s =
          dynamics::point_velocity(model_, ws_, model_.robot().tip.link, tip, v).norm();
      result.time_s = h * static_cast<double>(k_);
      if (result.distance_m < 0.02 && result.speed_m_s < 0.05) {
        result.reached = true;
        return result;
      }
      const Eigen::VectorXd gyroscopic = gyroscopic_torque();
      result.gyroscopic_work_J += h * std::abs(gyroscopic.dot(v));
      tau = buffers.held_torque() - buffers.potential_gradient() -
            buffers.damping().cwiseProduct(v) + gyroscopic;
      dynamics::forward_dynamics(model_, ws_, q, v, tau, a);
      v += h * a;
      q += h * v;
    }
    return result;
  }

 private:
  model::Model model_;
  dynamics::Workspace ws_;
  std::vector<Ball> balls_;
  Eigen::Vector3d goal_;
  Eigen::VectorXd q_goal_;
  double influence_ = 0.0;
  std::vector<hamelin_shape> shapes_;
  std::vector<hamelin_contact> contacts_;
  std::vector<planning::LoadedPlanner> planner_;
  std::uint64_t k_ = 0;

 public:
  Eigen::VectorXd q, v;
  hamelin_goal target{};
  planning::CommandBuffers buffers;
  double clearance = 0.0;
};

/// A loop with planner apf or gyro and the published law, unless the parameters name another
/// algorithm.
struct PublishedLoop : ArmLoop {
  PublishedLoop(const std::string& plugin_file, Json params, const model::Robot& robot,
                const Eigen::Vector3d& goal, std::vector<Ball> balls,
                const Eigen::Vector3d& gravity = Eigen::Vector3d::Zero(),
                const Eigen::VectorXd& q_goal = {})
      : ArmLoop(plugin_file, published(std::move(params)), robot, goal, std::move(balls), gravity,
                q_goal) {}
  static Json published(Json params) {
    if (!params.contains("algorithm")) params["algorithm"] = "published";
    return params;
  }
};

/// The ball and the goal of example 5.2.
inline const std::vector<Ball> ball_52{{{2.4, 2.2, 0.0}, 0.25}};
inline const Eigen::Vector3d goal_52{2.0, 3.0, 0.0};

/// Obstacles for a spatial arm with a reach of about 1 m; two of them are near it.
inline const std::vector<Ball> three_balls{
    {{1.2, 0.4, 0.3}, 0.1}, {{-0.8, 0.9, 0.1}, 0.2}, {{0.1, -1.4, 0.8}, 0.15}};

}  // namespace hamelin::test

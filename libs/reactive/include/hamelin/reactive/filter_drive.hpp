#pragma once
#include <optional>
#include <span>
#include <utility>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"
#include "hamelin/reactive/disturbance.hpp"
#include "hamelin/reactive/inertia.hpp"
#include "hamelin/reactive/obstacles.hpp"
#include "hamelin/reactive/safety_filter.hpp"
#include "hamelin/reactive/torque_ramp.hpp"

namespace hamelin::reactive {

/// How fast an arm may become faster or slower, and how fast obstacles and joint limits are
/// approached: a deceleration and a rate each, docs/theory.md (10.10).
struct Pace {
  double acceleration = 15.0;                  ///< of the joints, at most [rad/s² or m/s²]
  double brake = 3.0, rate = 16.0;             ///< of obstacles [m/s²], [1/s]
  double joint_brake = 7.5, joint_rate = 8.0;  ///< of joint limits [rad/s² or m/s²], [1/s]
};

/// Drives an arm by a desired joint velocity under the safety filter, within the limits of joints
/// and motors: docs/theory.md (10.7)–(10.23), (10.29)–(10.31). A tick calls update(), accelerate(),
/// begin_filter() and whatever else adds rows, then apply(). Only the constructor allocates.
class FilterDrive {
 public:
  /// @param radius_m obstacles beyond this distance are ignored
  /// @param horizon_s within which the velocity is reached, at least a control period; used where
  ///        actuation is sampled
  FilterDrive(const planning::Setup& setup, const model::Model& model, double radius_m,
              double horizon_s);
  void set_filter_passes(int passes) noexcept { filter_passes_ = passes; }

  /// Takes the state of a tick, its dynamics and its near points.
  void update(const planning::Tick& tick);

  [[nodiscard]] const Eigen::VectorXd& q() const noexcept { return q_; }
  [[nodiscard]] const Eigen::VectorXd& v() const noexcept { return v_; }
  /// The velocity from which the arm is accelerated: v, or where the rate of the torques is limited
  /// the velocity that the arm coasts to.
  [[nodiscard]] const Eigen::VectorXd& coasting_velocity() const noexcept { return w_; }
  /// The mass matrix and its inverse.
  [[nodiscard]] const Eigen::MatrixXd& M() const noexcept { return inertia_.M(); }
  [[nodiscard]] const Eigen::MatrixXd& M_inv() const noexcept { return inertia_.W(); }
  /// Contains the forward kinematics at q.
  [[nodiscard]] const dynamics::Workspace& ws() const noexcept { return ws_; }
  [[nodiscard]] std::span<NearPoint> points() noexcept { return obstacles_.points(); }
  [[nodiscard]] double horizon_s() const noexcept { return horizon_s_; }
  /// The bounds of a joint's velocity by its limits, where these are modelled.
  [[nodiscard]] std::pair<double, double> joint_bounds(int k, const Pace& pace) const;

  /// Sets the velocity after the horizon: u followed from `from` with a gain [1/s] and a bounded
  /// acceleration, docs/theory.md (10.7).
  void accelerate(const Eigen::VectorXd& u, const Eigen::VectorXd& from, double gain,
                  double acceleration) {
    x_ = w_ + horizon_s_ * (gain * (u - from)).cwiseMin(acceleration).cwiseMax(-acceleration);
  }
  /// Sets the bounds of joints and torques, and adds the rows of the near points: docs/theory.md
  /// (10.11)–(10.13), (10.20).
  /// @param softness called with each point: that of its row, 0 for a hard one, below 0 for none
  template <class Softness>
  void begin_filter(const Pace& pace, const Softness& softness) {
    begin_boxes(pace);
    for (const auto& point : obstacles_.points())
      if (const double soft = softness(point); soft >= 0.0) add_point(point, pace, soft);
  }
  /// Adds rows of what the tip keeps, after begin_filter(): docs/theory.md (21.5).
  void add_kept(const planning::Kept& kept, const Pace& pace);
  [[nodiscard]] SafetyFilter& filter() noexcept { return filter_; }
  /// Projects the velocity, and commands what leads to it.
  void apply(planning::Command& command);
  /// Whether an obstacle is near, or the filter of the last apply() changed the velocity.
  [[nodiscard]] bool held_back() const noexcept { return held_back_; }

 private:
  void begin_boxes(const Pace& pace);
  void add_point(const NearPoint& point, const Pace& pace, double softness);
  void set_joint_box(const Pace& pace);
  void set_momentum_box();
  [[nodiscard]] double joint_approach(int k, double offset, double side, const Pace& pace) const;
  void project(planning::Command& command);
  void answer_by_velocity(planning::Command& command);
  void answer_by_torque(planning::Command& command);

  const planning::Setup setup_;
  const model::Model& model_;
  dynamics::Workspace ws_;
  int filter_passes_ = 12;
  double radius_, horizon_s_;
  Inertia inertia_;
  Obstacles obstacles_;
  SafetyFilter filter_;
  Disturbance disturbance_;
  std::optional<TorqueRamp> ramp_;  ///< only where the rate of the torque is limited
  Eigen::VectorXd q_, v_, w_, x_, bias_, lower_, upper_, scratch_, torque_, last_torque_;
  bool held_back_ = false;
};

}  // namespace hamelin::reactive

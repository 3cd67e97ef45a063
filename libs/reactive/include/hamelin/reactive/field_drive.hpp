#pragma once
#include <algorithm>
#include <span>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"
#include "hamelin/reactive/disturbance.hpp"
#include "hamelin/reactive/inertia.hpp"
#include "hamelin/reactive/law.hpp"
#include "hamelin/reactive/obstacles.hpp"
#include "hamelin/reactive/repulsion.hpp"

namespace hamelin::reactive {

struct FieldDriveParams {
  double cruise_speed;  ///< of the fastest joint, by the attraction [rad/s or m/s]
  double range_m;       ///< near points are listed up to this distance
};

/// Drives an arm by a field of joint accelerations within the limits of its joints, after Khatib
/// (1986): docs/theory.md (9.19)–(9.29). A tick calls update(), then the functions that add to
/// the acceleration, then apply(). Only the constructor allocates.
class FieldDrive {
 public:
  /// Approaches are braked up to this distance [m].
  static constexpr double brake_range_m = 0.1;
  /// The distance up to which contacts are needed for a law that acts up to `range_m` [m].
  [[nodiscard]] static double contact_range_m(double range_m) {
    return std::max(brake_range_m, range_m);
  }

  FieldDrive(const planning::Setup& setup, const FieldDriveParams& params);

  /// Takes the state and the near points of a tick. The acceleration becomes that of the
  /// attraction, docs/theory.md (9.19), (9.20).
  void update(const planning::Tick& tick);

  [[nodiscard]] std::span<const NearPoint> points() noexcept { return obstacles_.points(); }
  /// The distance from the goal, docs/theory.md (10.24), and whether it is reached.
  [[nodiscard]] double goal_distance() const noexcept { return goal_distance_; }
  [[nodiscard]] bool at_goal() const noexcept { return at_goal_; }
  /// The factor with which repulsion vanishes at the goal, docs/theory.md (9.21).
  [[nodiscard]] double goal_factor() const noexcept { return goal_factor_; }
  /// The joint acceleration so far.
  [[nodiscard]] const Eigen::VectorXd& acceleration() const noexcept { return a_; }
  /// The rate at which the point's distance shrinks [m/s].
  [[nodiscard]] double approach_speed(const NearPoint& point) const {
    return point.obstacle_speed - point.row.dot(v_);
  }
  /// The velocity of the arm's point [m/s].
  [[nodiscard]] Eigen::Vector3d velocity(const NearPoint& point) const;
  /// The damped operational-space inertia [kg] at the arm's point, docs/theory.md (2.21).
  [[nodiscard]] Eigen::Matrix3d inertia(const NearPoint& point);

  /// Accelerates the point's distance by f [m/s²], docs/theory.md (9.22).
  void push(const NearPoint& point, double f);
  /// Brakes an approach that is faster than the distance from the point allows, docs/theory.md
  /// (9.23).
  void brake(const NearPoint& point);
  /// Adds the gyroscopic force w × ẋ at the arm's point to the command, and to the acceleration
  /// that the limits below bound. @param w world axes [N s/m]
  void turn(const NearPoint& point, const Eigen::Vector3d& w, planning::Command& command);
  /// Adds the acceleration by a force [N] at the arm's point.
  void pull(const NearPoint& point, const Eigen::Vector3d& force);

  /// Sets the held torque that gives the acceleration, bounded such that the arm keeps its limits:
  /// docs/theory.md (9.24)–(9.29).
  void apply(planning::Command& command);

 private:
  void attract(const planning::Tick& tick);
  void repel_joint_limits();
  void bound_turning(planning::Command& command);
  void bound_acceleration();
  [[nodiscard]] double joint_room(double offset) const;

  const planning::Setup setup_;
  model::Model model_;
  dynamics::Workspace ws_;
  double horizon_s_;  ///< within which the velocity bounds are reached
  Law law_;
  Inertia inertia_;
  Obstacles obstacles_;
  Disturbance disturbance_;
  Eigen::VectorXd q_, v_, a_, row_, Wa_, turning_, turned_, torque_;
  dynamics::Matrix3Xd J_;
  double goal_distance_ = 0.0, goal_factor_ = 1.0;
  bool at_goal_ = false;
};

}  // namespace hamelin::reactive

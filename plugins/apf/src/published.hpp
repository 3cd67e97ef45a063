#pragma once
#include "hamelin/planning/nominal_arm.hpp"
#include "hamelin/planning/plugin.hpp"
#include "hamelin/reactive/repulsion.hpp"

namespace hamelin::apf {

/// The potential field of Shen, Wang, Shi (2021) as published: forces at the tip and at the nearest
/// points of the links, without regard to the limits of the joints.
class Published final : public planning::Planner {
 public:
  Published(const planning::Setup& setup, const Json& params);
  void tick(const planning::Tick& tick, planning::Command& command) override;

 private:
  /// The factor by which the law wang2018 multiplies the repulsion's potential, and its gradient. r
  /// is the distance |x_e − x_d| of the tip from the goal, for joint goals |q − q_d|, and n the
  /// exponent. docs/theory.md (9.8), (9.9)
  struct GoalScale {
    double value;            ///< r^n
    double gradient_factor;  ///< n r^(n−2): the gradient is this times x_e − x_d; zero at the goal
  };
  [[nodiscard]] GoalScale goal_scale(double distance_squared) const;
  [[nodiscard]] double goal_distance_squared(const hamelin_goal& goal) const;
  /// Attraction and repulsion, each mapped at its own point: docs/theory.md (9.1), (9.2), (9.4).
  void operational(const planning::Tick& tick, planning::Command& command);
  /// The potential V = ½ k_p r² + Σ V(ρ), for wang2018 with the sum multiplied by r^n, and its
  /// gradient in joint space: docs/theory.md (9.7), (9.8).
  void potential(const planning::Tick& tick, planning::Command& command);

  planning::Setup setup_;
  planning::NominalArm arm_;
  double k_p_, k_v_;
  reactive::Repulsion repulsion_;
  double joint_damping_;
  bool potential_mapping_, goal_scaled_;
  double goal_exponent_;
  bool gravity_compensation_;
  Eigen::VectorXd tau_;
};

}  // namespace hamelin::apf

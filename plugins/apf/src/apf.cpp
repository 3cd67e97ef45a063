#include <cmath>

#include "hamelin/planning/nominal_arm.hpp"
#include "params_schema.hpp"

namespace {

using Eigen::Vector3d;
using namespace hamelin::planning;

/// The repulsion at the distance ρ: its potential V(ρ) = ½ η (1/ρ − 1/ρ0)² and its force −V'(ρ).
/// Below ρ_min the force is constant and V continues as a straight line.
/// docs/theory.md (9.2), (9.3)
struct Repulsion {
  double eta, rho0, rho_min;

  [[nodiscard]] double force(double rho) const {
    const double r = std::max(rho, rho_min);
    return eta * (1.0 / r - 1.0 / rho0) / (r * r);
  }
  [[nodiscard]] double potential(double rho) const {
    const double r = std::max(rho, rho_min), s = 1.0 / r - 1.0 / rho0;
    return 0.5 * eta * s * s + force(r) * (r - std::min(rho, r));
  }
};

class Apf : public Planner {
 public:
  static double influence_m(const hamelin::Json& params) {
    return params.at("rho0_m").get<double>();
  }

  Apf(const Host&, const Setup& setup, const hamelin::Json& params)
      : setup_(setup),
        arm_(setup),
        k_p_(params.at("k_p").get<double>()),
        k_v_(params.at("k_v").get<double>()),
        repulsion_{params.at("eta").get<double>(), params.at("rho0_m").get<double>(),
                   params.at("distance_min_m").get<double>()},
        joint_damping_(params.at("joint_damping").get<double>()),
        potential_mapping_(params.at("mapping") == "potential"),
        goal_scaled_(params.at("law") == "wang2018"),
        goal_exponent_(params.at("goal_exponent").get<double>()),
        gravity_compensation_(params.at("gravity_compensation").get<bool>()),
        tau_(setup.dof()) {
    if (repulsion_.rho_min > repulsion_.rho0)
      throw hamelin::Error(hamelin::ErrorCode::invalid,
                           "/distance_min_m: above rho0_m, expected at most rho0_m");
  }

  void tick(const Tick& tick, Command& command) override {
    arm_.update(tick);
    command.damping().setConstant(joint_damping_);
    if (potential_mapping_) {
      potential(tick, command);
    } else {
      operational(tick, command);
    }
    if (gravity_compensation_) {
      tau_.setZero();
      arm_.add_gravity(tau_);
      command.held_torque() += tau_;
    }
  }

 private:
  /// The factor by which the law wang2018 multiplies the repulsion's potential, and its gradient. r
  /// is the distance |x_e − x_d| of the tip from the goal, for joint goals |q − q_d|, and n the
  /// exponent. docs/theory.md (9.8), (9.9)
  struct GoalScale {
    double value;            ///< r^n
    double gradient_factor;  ///< n r^(n−2): the gradient is this times x_e − x_d; zero at the goal
  };
  [[nodiscard]] GoalScale goal_scale(double distance_squared) const {
    if (!goal_scaled_) return {1.0, 0.0};
    if (distance_squared == 0.0) return {0.0, 0.0};
    const double n = goal_exponent_;
    return {std::pow(distance_squared, 0.5 * n), n * std::pow(distance_squared, 0.5 * n - 1.0)};
  }

  [[nodiscard]] double goal_distance_squared(const hamelin_goal& goal) const {
    if (goal.type == HAMELIN_GOAL_JOINT)
      return (arm_.q() - ConstVectorMap(goal.q, arm_.q().size())).squaredNorm();
    return (arm_.tip_position() - vec3(goal.position_world_m)).squaredNorm();
  }

  /// Attraction and repulsion, each mapped at its own point: docs/theory.md (9.1), (9.2), (9.4).
  void operational(const Tick& tick, Command& command) {
    const hamelin_goal& goal = tick.goal();
    const GoalScale scale = goal_scale(goal_distance_squared(goal));
    double attraction = k_p_ * tick.speed_scale();
    tau_.setZero();
    for_each_nearest(
        tick.contacts(), setup_.shapes(), repulsion_.rho0, [&](const hamelin_contact& c, int link) {
          const Vector3d f = scale.value * repulsion_.force(c.distance_m) * vec3(c.direction_world);
          arm_.add_mapped(link, vec3(c.arm_point_world_m), f, tau_);
          attraction += scale.gradient_factor * repulsion_.potential(c.distance_m);
        });
    arm_.add_mapped_attraction(goal, attraction, k_v_, tau_);
    command.held_torque() = tau_;
  }

  /// The potential V = ½ k_p r² + Σ V(ρ), for wang2018 with the sum multiplied by r^n, and its
  /// gradient in joint space: docs/theory.md (9.7), (9.8).
  void potential(const Tick& tick, Command& command) {
    const hamelin_goal& goal = tick.goal();
    const double distance_squared = goal_distance_squared(goal), k_p = k_p_ * tick.speed_scale();
    const GoalScale scale = goal_scale(distance_squared);
    double attraction = k_p, value = 0.5 * k_p * distance_squared;
    tau_.setZero();  // −∂V
    for_each_nearest(
        tick.contacts(), setup_.shapes(), repulsion_.rho0, [&](const hamelin_contact& c, int link) {
          const double V = repulsion_.potential(c.distance_m);
          const Vector3d f = scale.value * repulsion_.force(c.distance_m) * vec3(c.direction_world);
          arm_.add_force(link, vec3(c.arm_point_world_m), f, tau_);
          attraction += scale.gradient_factor * V;
          value += scale.value * V;
        });
    if (goal.type == HAMELIN_GOAL_JOINT) {
      tau_ -= attraction * (arm_.q() - ConstVectorMap(goal.q, arm_.q().size()));
    } else {
      const Vector3d tip = arm_.tip_position();
      arm_.add_force(arm_.tip_link(), tip, -attraction * (tip - vec3(goal.position_world_m)), tau_);
    }
    command.set_potential(value);
    command.potential_gradient() = -tau_;
  }

  Setup setup_;
  NominalArm arm_;
  double k_p_, k_v_;
  Repulsion repulsion_;
  double joint_damping_;
  bool potential_mapping_, goal_scaled_;
  double goal_exponent_;
  bool gravity_compensation_;
  Eigen::VectorXd tau_;
};

}  // namespace

HAMELIN_PLANNER_PLUGIN(Apf, "apf", "0.1.0",
                       "Artificial potential field: the goal attracts, obstacles repel",
                       params_schema);

#include "hamelin/planning/nominal_arm.hpp"
#include "params_schema.hpp"

namespace {

using namespace hamelin::planning;

// Spring to the goal, damping of each joint, compensation of gravity. Obstacles are ignored.
class Template : public Planner {
 public:
  Template(const Host& host, const Setup& setup, const hamelin::Json& params)
      : setup_(setup),
        arm_(setup),
        gains_(prepare_params(params)),
        tau_(setup.dof()),
        energy_series_(host.declare_series("energy of the spring", "J")) {
    host.info("template: obstacles are ignored");
  }

  void tick(const Tick& tick, Command& command) override {
    arm_.update(tick);
    tau_.setZero();
    const double distance = add_spring(tick.goal());
    arm_.add_gravity(tau_);
    command.held_torque() = tau_;
    command.damping().setConstant(gains_.damping);
    command.set_series(energy_series_, 0.5 * gains_.stiffness * distance * distance);
  }

  // The rest is optional. With these two, parameters can change while the planner runs: the first
  // runs on any thread and may allocate, the second before a tick.
  struct Gains {
    double stiffness, damping;
  };
  [[nodiscard]] Gains prepare_params(const hamelin::Json& params) const {
    return {params.at("stiffness").get<double>(), params.at("damping").get<double>()};
  }
  void apply_params(const Gains& gains) { gains_ = gains; }

 private:
  // @return the length of the spring
  double add_spring(const hamelin_goal& goal) {
    if (goal.type == HAMELIN_GOAL_JOINT) {
      const ConstVectorMap q_goal(goal.q, setup_.dof());
      tau_ -= gains_.stiffness * (arm_.q() - q_goal);
      return (arm_.q() - q_goal).norm();
    }
    const Eigen::Vector3d tip = arm_.tip_position(), to_tip = tip - vec3(goal.position_world_m);
    arm_.add_force(arm_.tip_link(), tip, -gains_.stiffness * to_tip, tau_);
    return to_tip.norm();
  }

  Setup setup_;
  NominalArm arm_;
  Gains gains_;
  Eigen::VectorXd tau_;
  std::int32_t energy_series_;
};

}  // namespace

HAMELIN_PLANNER_PLUGIN(Template, "template", "0.1.0",
                       "Spring to the goal without avoidance, an example to copy", params_schema);

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
        stiffness_(params.at("stiffness").get<double>()),
        damping_(params.at("damping").get<double>()),
        tau_(setup.dof()) {
    host.info("template: obstacles are ignored");
  }

  void tick(const Tick& tick, Command& command) override {
    arm_.update(tick);
    const hamelin_goal& goal = tick.goal();
    tau_.setZero();
    if (goal.type == HAMELIN_GOAL_JOINT) {
      tau_ = -stiffness_ * (arm_.q() - ConstVectorMap(goal.q, setup_.dof()));
    } else {
      const Eigen::Vector3d tip = arm_.tip_position();
      arm_.add_force(arm_.tip_link(), tip, -stiffness_ * (tip - vec3(goal.position_world_m)), tau_);
    }
    arm_.add_gravity(tau_);
    command.held_torque() = tau_;
    command.damping().setConstant(damping_);
  }

 private:
  Setup setup_;
  NominalArm arm_;
  double stiffness_, damping_;
  Eigen::VectorXd tau_;
};

}  // namespace

HAMELIN_PLANNER_PLUGIN(Template, "template", "0.1.0",
                       "Spring to the goal without avoidance, an example to copy", params_schema);

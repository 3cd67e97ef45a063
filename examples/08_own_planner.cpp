// A planner of your own, a plugin: springs and dampers at the joints. Any program of hamelin loads
// it.
#include <hamelin/planning/nominal_arm.hpp>
#include <hamelin/planning/plugin.hpp>

namespace {

using namespace hamelin::planning;

constexpr const char* params_schema = R"({
  "type": "object", "additionalProperties": false,
  "properties": {"k": {"type": "number", "minimum": 0, "default": 30.0}}
})";

class Springs : public Planner {
 public:
  Springs(const Host&, const Setup& setup, const hamelin::Json& params)
      : arm_(setup), k_(params.at("k").get<double>()), tau_(setup.dof()) {}

  void tick(const Tick& tick, Command& command) override {
    arm_.update(tick);
    const ConstVectorMap goal(tick.goal().q, tau_.size());
    tau_ = k_ * (goal - arm_.q());
    arm_.add_gravity(tau_);
    command.held_torque() = tau_;
    command.damping().setConstant(2.0 * std::sqrt(k_));
  }

 private:
  NominalArm arm_;
  double k_;
  Eigen::VectorXd tau_;
};

}  // namespace

HAMELIN_PLANNER_PLUGIN(Springs, "springs", "1.0.0", "Springs to the goal, without avoidance",
                       params_schema);

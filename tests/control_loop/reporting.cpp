// A planner that reports in its series what it was shown in each tick, so that a test can compare
// it with the world, the goals and the parameters that were set. It drives the joints straight to
// joint goals, through obstacles, and rests at other goals. It can be late: it sleeps in each tick.
#include <algorithm>
#include <chrono>
#include <limits>
#include <thread>

#include "hamelin/planning/nominal_arm.hpp"

namespace {

using namespace hamelin::planning;

constexpr const char* schema = R"({
  "type": "object",
  "additionalProperties": false,
  "properties": {
    "gain": {"type": "number", "minimum": 0, "default": 4},
    "sleep_s": {"type": "number", "minimum": 0, "default": 0}
  }
})";

struct Tuning {
  double gain, sleep_s;
};

class Reporting : public Planner {
 public:
  static double influence_m(const hamelin::Json&) { return 0.2; }

  Reporting(const Host& host, const Setup& setup, const hamelin::Json& params)
      : arm_(setup),
        tuning_(prepare_params(params)),
        torque_(setup.dof()),
        world_(host.declare_series("world", "")),
        nearest_(host.declare_series("nearest contact", "m")),
        obstacle_(host.declare_series("obstacle of the nearest contact", "")),
        gain_(host.declare_series("gain", "1/s")),
        goal_(host.declare_series("first number of the goal", "")),
        sent_(host.declare_series("first torque sent", "Nm")) {}

  [[nodiscard]] Tuning prepare_params(const hamelin::Json& params) const {
    return {params.at("gain").get<double>(), params.at("sleep_s").get<double>()};
  }
  void apply_params(const Tuning& tuning) { tuning_ = tuning; }

  void tick(const Tick& tick, Command& command) override {
    if (tuning_.sleep_s > 0.0)
      std::this_thread::sleep_for(std::chrono::duration<double>(tuning_.sleep_s));
    report(tick, command);
    arm_.update(tick);
    torque_.setZero();
    arm_.add_gravity(torque_);
    command.held_torque() = torque_;
    const hamelin_goal& goal = tick.goal();
    auto velocity = command.node_velocity();
    if (goal.type == HAMELIN_GOAL_JOINT)
      velocity = (tuning_.gain * (ConstVectorMap(goal.q, velocity.size()) - tick.q()))
                     .cwiseMin(1.0)
                     .cwiseMax(-1.0);
  }

 private:
  void report(const Tick& tick, Command& command) {
    double nearest = std::numeric_limits<double>::infinity();
    int obstacle = 0;
    for (const auto& contact : tick.contacts())
      if (contact.distance_m < nearest) {
        nearest = contact.distance_m;
        obstacle = contact.obstacle;
      }
    const hamelin_goal& goal = tick.goal();
    command.set_series(world_, static_cast<double>(tick.world()));
    command.set_series(nearest_, nearest);
    command.set_series(obstacle_, obstacle);
    command.set_series(gain_, tuning_.gain);
    command.set_series(goal_,
                       goal.type == HAMELIN_GOAL_JOINT ? goal.q[0] : goal.position_world_m[0]);
    const auto sent = tick.torque();
    command.set_series(sent_, sent ? (*sent)[0] : std::numeric_limits<double>::infinity());
  }

  NominalArm arm_;
  Tuning tuning_;
  Eigen::VectorXd torque_;
  std::int32_t world_, nearest_, obstacle_, gain_, goal_, sent_;
};

}  // namespace

HAMELIN_PLANNER_PLUGIN(Reporting, "reporting", "0.0.1", "reports what it is shown", schema);

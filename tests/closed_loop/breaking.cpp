// A planner that does nothing until a given tick, where it breaks a rule that must end the run.
#include <limits>
#include <stdexcept>
#include <string>

#include "hamelin/planning/plugin.hpp"

namespace {

using namespace hamelin::planning;

constexpr const char* schema = R"({
  "type": "object",
  "additionalProperties": false,
  "properties": {
    "at_tick": {"type": "integer", "minimum": 0, "default": 0},
    "how": {"type": "string", "enum": ["throw", "nan", "huge", "huge velocity", "give up", "never"], "default": "never"}
  }
})";

class Breaking : public Planner {
 public:
  Breaking(const Host&, const Setup&, const hamelin::Json& params)
      : at_tick_(params.at("at_tick").get<std::uint64_t>()),
        how_(params.at("how").get<std::string>()) {}

  void tick(const Tick& tick, Command& command) override {
    if (tick.k() != at_tick_) return;
    if (how_ == "throw") throw std::runtime_error("out of ideas");
    if (how_ == "nan") command.held_torque()[0] = std::numeric_limits<double>::quiet_NaN();
    if (how_ == "huge") {  // both are finite, their sum is not
      command.held_torque().setConstant(1.7e308);
      command.potential_gradient().setConstant(-1.7e308);
    }
    if (how_ == "huge velocity") command.node_velocity().setConstant(1.7e308);
    if (how_ == "give up") command.give_up("no path to the goal");
  }

 private:
  std::uint64_t at_tick_;
  std::string how_;
};

}  // namespace

HAMELIN_PLANNER_PLUGIN(Breaking, "breaking", "0.0.1", "does nothing, then breaks a rule", schema);

#pragma once
#include <cstdint>

#include "hamelin/planning/plugin.hpp"

namespace hamelin::reactive {

/// Ends the run where the arm rests away from its goal, in place of the scene's stall rule, which
/// also ends motions that turn around obstacles without coming nearer to the goal.
class RestRule {
 public:
  static constexpr double speed = 0.01;  ///< below it the arm rests [rad/s or m/s]
  static constexpr double rest_s = 3.0;  ///< after this time the run ends

  explicit RestRule(const planning::Setup& setup) : period_s_(setup.control_period_s()) {}

  /// Counts ticks at rest. An arm may have to wait where obstacles move, and where the scene
  /// requires that it stands still.
  void check(const planning::Tick& tick, bool at_goal, planning::Command& command) {
    command.disable_stall_rule();
    const bool rests =
        !at_goal && tick.v().norm() < speed && tick.moving_count() == 0 && tick.speed_scale() > 0.0;
    ticks_ = rests && tick.goal_number() == goal_number_ ? ticks_ + 1 : 0;
    goal_number_ = tick.goal_number();
    if (period_s_ * static_cast<double>(ticks_) > rest_s)
      command.give_up("force balance: the arm has rested for 3 s away from the goal");
  }

 private:
  double period_s_;
  std::uint64_t goal_number_ = 0, ticks_ = 0;
};

}  // namespace hamelin::reactive

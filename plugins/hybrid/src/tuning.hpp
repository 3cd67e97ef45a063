#pragma once
#include "follower.hpp"
#include "hamelin/io/json.hpp"
#include "parts.hpp"

namespace hamelin::hybrid {

/// The parameters that can change while the planner runs: those that need no memory of their own.
struct Tuning {
  Tuning(const planning::Setup& setup, const Json& params);

  LawParams law;
  MarginParams margins;
  FollowParams follow;
  double velocity_gain, follow_gain, target_velocity_gain, drive_acceleration, acceleration_max,
      path_acceleration, brake_acceleration, approach_rate, joint_damping, stall_time_s;
  int filter_passes, look_budget, look_steps;
};

/// @throws Error invalid if `params` differ from `initial` in one that cannot change
void check_fixed_params(const Json& params, const Json& initial);

}  // namespace hamelin::hybrid

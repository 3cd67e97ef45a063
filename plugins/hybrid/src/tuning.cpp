#include "tuning.hpp"

#include <array>

namespace hamelin::hybrid {

namespace {

constexpr double joint_speed_share = 1.5;  // of the cruise speed, for |u| towards a target

// These determine the crop of the map, or what the planner is made of.
constexpr std::array fixed{"contact_radius_m", "escape", "horizon_s", "steering", "turns"};

double value_or(const Json& value, double otherwise) {
  return value.is_null() ? otherwise : value.get<double>();
}

// A law ë = −k_p e − k_v ė is equivalent to following the velocity (k_p/k_v) e with the gain k_v.
LawParams law_params(const Json& params) {
  const double gain =
      params["k_p"].is_null() ? 0.0 : params["k_p"].get<double>() / value_or(params["k_v"], 1.0);
  return {gain > 0.0 ? gain : LawParams{}.joint_gain,
          gain > 0.0 ? gain : LawParams{}.tip_gain,
          params["cruise_speed"],
          params["tip_speed_m_s"],
          params["tip_turn_rad_s"],
          params["repulsion_range_m"],
          params["repulsion_speed_m_s"]};
}

MarginParams margin_params(const planning::Setup& setup, const Json& params) {
  const double at_goal = params["goal_margin_m"];
  return margins_in_scene(setup, {params["margin_m"], at_goal, at_goal, params["self_margin_m"]});
}

}  // namespace

Tuning::Tuning(const planning::Setup& setup, const Json& params)
    : law(law_params(params)),
      margins(margin_params(setup, params)),
      follow{params["target_gain"],       params["tip_speed_m_s"],
             params["tip_turn_rad_s"],    joint_speed_share * params["cruise_speed"].get<double>(),
             params["repulsion_range_m"], params["repulsion_speed_m_s"]},
      velocity_gain(value_or(params["k_v"], params["velocity_gain"])),
      follow_gain(params["velocity_gain"]),
      target_velocity_gain(params["target_velocity_gain"]),
      drive_acceleration(params["drive_acceleration"]),
      acceleration_max(params["acceleration_max"]),
      path_acceleration(params["path_acceleration"]),
      brake_acceleration(params["brake_acceleration"]),
      approach_rate(params["approach_rate"]),
      joint_damping(params["joint_damping"]),
      stall_time_s(params["stall_time_s"]),
      filter_passes(params["filter_passes"]),
      look_budget(params["look_budget"]),
      look_steps(params["look_steps"]) {}

void check_fixed_params(const Json& params, const Json& initial) {
  planning::check_fixed_params(params, initial, fixed);
}

}  // namespace hamelin::hybrid

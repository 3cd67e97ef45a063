#include "tuning.hpp"

#include <array>

namespace hamelin::mppi {

namespace {

constexpr std::array fixed_params{"samples",  "horizon_s",     "plan_period_s",     "threads",
                                  "margin_m", "goal_margin_m", "clearance_range_m", "query_range_m",
                                  "guide",    "tracking_rate", "record_rollouts"};

}  // namespace

Tuning::Tuning(const Json& params)
    : cost{params["smoothness_weight_s"], params["clearance_weight_s"]},
      temperature_s(params["temperature_s"]),
      noise(params["noise_rad"]),
      cruise_speed(params["cruise_speed"]),
      acceleration_max(params["acceleration_max"]),
      stall_time_s(params["stall_time_s"]) {}

void check_fixed_params(const Json& params, const Json& initial) {
  planning::check_fixed_params(params, initial, fixed_params);
}

}  // namespace hamelin::mppi

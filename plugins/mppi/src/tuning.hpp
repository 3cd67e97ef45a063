#pragma once
#include "hamelin/planning/plugin.hpp"
#include "task.hpp"

namespace hamelin::mppi {

/// The parameters that may change while the planner runs. Plans use them from the next one on.
struct Tuning {
  explicit Tuning(const Json& params);

  CostParams cost;
  double temperature_s, noise, cruise_speed, acceleration_max, stall_time_s;
};

/// @throws Error invalid if a parameter differs that determines the size of memory, the crop of the
/// map, or what was verified
void check_fixed_params(const Json& params, const Json& initial);

}  // namespace hamelin::mppi

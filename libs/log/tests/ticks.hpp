#pragma once
#include "hamelin/io/json.hpp"

namespace hamelin::test {

/// The fields of a tick of one joint at step k of 1 ms.
inline Json tick(long k) {
  return {{"k", k},
          {"time_s", 0.001 * static_cast<double>(k)},
          {"q", {0.1}},
          {"v", {0.0}},
          {"energy",
           {{"kinetic_J", 0.0},
            {"potential_J", 2.7},
            {"control_J", 0.0},
            {"gyroscopic_work_J", 0.0},
            {"filter_work_J", 0.0},
            {"recovery_work_J", 0.0},
            {"dissipated_J", 0.0},
            {"held_work_J", 0.0}}},
          {"solver", {{"updates", 1}, {"residual", 1e-14}, {"halvings", 0}}}};
}

}  // namespace hamelin::test

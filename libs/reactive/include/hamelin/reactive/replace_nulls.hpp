#pragma once
#include "hamelin/io/json.hpp"

namespace hamelin::reactive {

/// Gives parameters that are null the values of one algorithm of a planner.
/// @param values an object; its keys are parameters
[[nodiscard]] inline Json replace_nulls(Json params, const Json& values) {
  for (const auto& [key, value] : values.items())
    if (params.at(key).is_null()) params[key] = value;
  return params;
}

}  // namespace hamelin::reactive

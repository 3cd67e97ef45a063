#pragma once
#include "hamelin/io/json.hpp"

/// JSON Schemas of the messages. Those named foxglove.… have the fields of the schemas that
/// Foxglove publishes (npm: @foxglove/schemas), without their descriptions; a test compares them.
namespace hamelin::mcap {

[[nodiscard]] Json frame_transforms_schema();
[[nodiscard]] Json joint_states_schema();
[[nodiscard]] Json scene_update_schema();
[[nodiscard]] Json log_schema();
/// hamelin's own: what viewers plot.
[[nodiscard]] Json state_schema();

}  // namespace hamelin::mcap

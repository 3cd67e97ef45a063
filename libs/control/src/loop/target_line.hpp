#pragma once
#include <string>
#include <string_view>
#include <variant>

#include "hamelin/control/live_target.hpp"

namespace hamelin::control {

/// What a line of a stream of targets says.
using TargetSample = std::variant<TargetPose, TargetTwist>;

/// Reads one line of JSON: a pose (`time_s`, `position_m`, `quaternion_wxyz`, and optionally
/// `velocity_m_s`, `acceleration_m_s2`, `angular_velocity_rad_s`), or without a position a twist.
/// SI units, radians, world axes.
/// @param where prefix of the message @param position_only whether poses need no orientation
/// @throws Error parse or invalid, one line that says what is wrong and what was expected
[[nodiscard]] TargetSample read_target_line(std::string_view text, const std::string& where,
                                            bool position_only);

}  // namespace hamelin::control

#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/log/trajectory.hpp"

/// Messages made from the lines of a log alone. Lines have been checked by their schema.
namespace hamelin::mcap {

/// A foxglove.JointStates. Numbers that are not finite are left out.
[[nodiscard]] Json joint_states(std::uint64_t time_ns, const std::vector<std::string>& joints,
                                const log::Trajectory::Point& point);

/// A hamelin.State. Numbers that the tick does not have are left out.
/// @param series names of the planner's series
[[nodiscard]] Json state(std::uint64_t time_ns, const Json& tick,
                         const std::vector<std::string>& series);

/// A foxglove.Log of an event or a result.
[[nodiscard]] Json log_entry(std::uint64_t time_ns, const Json& line);

}  // namespace hamelin::mcap

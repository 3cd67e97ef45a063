#pragma once
#include <cstddef>

#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::planning {

/// Describes the first error in a planner's answer, or returns null.
[[nodiscard]] const char* defect(const CommandBuffers& out, std::size_t dof,
                                 std::size_t gyroscopic_capacity);

}  // namespace hamelin::planning

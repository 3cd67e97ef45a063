#pragma once
#include "courses.hpp"

/// Stalls on the way to a goal at rest.
namespace hamelin::hybrid {

/// Whether the arm has stalled. Takes the scene's rule of stalls out of force where the planner
/// has its own means.
[[nodiscard]] bool has_stalled(Shared& s, const TickEnd& end);
/// Asks for another path, or gives up with the cause where the planner may not ask.
[[nodiscard]] Next leave_stall(Shared& s, const TickEnd& end);

}  // namespace hamelin::hybrid

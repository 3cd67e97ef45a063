#pragma once
#include "hamelin/timing/timed_path.hpp"

namespace hamelin::timing {

/// σ(t) of a motion averaged over a window of time, so that accelerations change within it instead
/// of jumping: docs/theory.md (19.12). The place, time_s, speed, rate and ramp of `out` are set, at
/// equal times: so many intervals per window.
void average(const TimedPath& motion, double window_s, int intervals, TimedPath& out);

}  // namespace hamelin::timing

#pragma once
#include <filesystem>

#include "hamelin/io/json.hpp"
#include "hamelin/sweep/make_plan.hpp"

namespace hamelin::sweep {

/// The scene of gain sets, as the README describes it: that of `base` with rows of spheres in place
/// of the segments of its arm. Writes the robot's file into the folder of the scene.
/// @throws Error io, parse, invalid
[[nodiscard]] Json make_gain_scene(const std::filesystem::path& base,
                                   const std::filesystem::path& folder);

/// Puts a gain set into a run; each planner has its own names for the gains.
void set_gains(PlannedRun& run, const Gains& g);

}  // namespace hamelin::sweep

#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/sweep/make_plan.hpp"

/// Ablations: runs of a planner with one of its parts switched off, to see what the part
/// contributes.
namespace hamelin::sweep {

/// A planner and the same planner without one part.
/// @param planner as in PlanOptions::planners
/// @param part "PARAMETER": a boolean is negated, a number becomes 0; or "PARAMETER=VALUE"
/// @param plugin_directories where planners are searched
/// @throws Error usage, one line, if the planner has no such parameter, or it cannot have that
/// value
///         or has it already; plugin for a missing planner
[[nodiscard]] Ablation make_ablation(const std::string& planner, const std::string& part,
                                     const std::vector<std::filesystem::path>& plugin_directories);

/// Adds to a plan each of its planners without each of these parts, behind the planner itself.
/// @param parts as for make_ablation()
/// @throws Error as make_ablation(); usage for a part that is given twice, and for one that
///         `options.set` sets in all runs
void add_ablations(PlanOptions& options, const std::vector<std::string>& parts);

/// What differs, as "PARAMETER=VALUE".
[[nodiscard]] std::string part_of(const Ablation& ablation);

}  // namespace hamelin::sweep

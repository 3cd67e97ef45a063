#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/simulation/run.hpp"
#include "hamelin/sweep/judge.hpp"

namespace hamelin::sweep {

/// A run and what the judge saw of it.
struct JudgedRun {
  log::Result result;
  Verdict verdict;
};

/// Runs a scene as simulation::run(), with the judge at every node.
/// @param watch its at_node is called as well
/// @throws Error as simulation::run() and Judge
[[nodiscard]] JudgedRun run_under_judge(
    const scene::Scene& scene, const std::vector<std::filesystem::path>& plugin_directories,
    const simulation::Watch& watch, const simulation::PlantFactory& plant_factory = {});

/// {result, judge} as a line of JSON without its end, from which a sweep makes a record.
[[nodiscard]] std::string to_line(const JudgedRun& run);

}  // namespace hamelin::sweep

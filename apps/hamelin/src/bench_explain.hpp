#pragma once
#include <filesystem>
#include <vector>

#include "hamelin/bench/results.hpp"

namespace hamelin::app {

/// Repeats each run that ended in contact with an obstacle that moves, with a log, and searches
/// whether the contact was avoidable. Writes both to the folder contacts/ of the benchmark, and
/// skips runs that have an explanation.
/// @param directories to search first for planners
/// @throws Error as repeat_run() and simulation::explain()
void explain_contacts(const bench::Results& results, const std::filesystem::path& directory,
                      const std::vector<std::filesystem::path>& directories);

}  // namespace hamelin::app

#pragma once
#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "hamelin/sweep/judged_run.hpp"
#include "hamelin/sweep/page.hpp"

namespace hamelin::app {

struct ReplayRequest {
  std::size_t per_class = 0;   ///< failed runs to replay, of each class and planner
  std::filesystem::path page;  ///< page of the study; the others go into a folder beside it
  std::vector<std::filesystem::path> plugin_path;
};

/// Repeats one run with its judge and writes its log.
/// @param directories to search first for planners
/// @throws Error as sweep::read_scene and simulation::run
sweep::JudgedRun repeat_run(const sweep::MergedRun& run, const std::filesystem::path& log_file,
                            const std::vector<std::filesystem::path>& directories);

/// Repeats the first failed runs of each class and planner, and writes a page of each, as `hamelin
/// report` does. The judge's contact becomes an event of the page. Runs that crashed are not
/// repeated.
/// @return links by the index of the run
/// @throws Error as sweep::read_scene, simulation::run and report::make_data
[[nodiscard]] std::map<std::size_t, sweep::ReplayLink> write_replays(const sweep::Merged& merged,
                                                                     const ReplayRequest& request);

}  // namespace hamelin::app

#pragma once
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/io/json.hpp"

namespace hamelin::report {

struct Options {
  std::size_t frames_max = 2000;       ///< poses of the arm per run, at least 2
  std::size_t plot_points_max = 1500;  ///< points per plotted line, at least 4
};

/// What went into the page of one run.
struct RunSummary {
  std::string name;  ///< the planner's, or the integrator's in free motion; with the log's if several share it
  std::filesystem::path log;
  std::string outcome;  ///< as in the log's result; "unfinished" without one
  double time_s = 0.0;  ///< of the last tick
  std::size_t ticks = 0, frames = 0;
  std::vector<std::string> notes;  ///< what a reader should know: inputs that changed, a log that was cut
};

/// What a page shows, as it is handed to the page's script (format hamelin.report/1; this library's README says how the
/// bytes are laid out).
struct Data {
  std::string bytes;
  std::vector<RunSummary> runs;
};

/// Reads logs, plain or zstd, and makes a page's data of them. Runs of one robot, map, obstacles and goals share a
/// world. Clearances, closest points and forces at the tip are recomputed from the robot and the map, which are looked
/// for as simulation::read_header does; without the very map that a run had, its page goes without map and clearances,
/// and says so. A log is read line by line: memory grows with the options, not with the log. Equal inputs give equal
/// bytes.
/// @throws Error usage for no logs or options out of range; io, parse or invalid for a file that is no log, a damaged
/// line, or a robot that is missing or no longer fits
[[nodiscard]] Data make_data(const std::vector<std::filesystem::path>& logs, const Options& options = {});

/// A page's data that is JSON alone, as the pages of sweeps and of accuracy have it, in the same form as Data::bytes.
[[nodiscard]] std::string pack(const Json& data);

/// The text in a page's template that the data takes the place of.
inline constexpr std::string_view token = "__HAMELIN_REPORT_DATA__";

/// The template with base64(gzip(data)) in place of its token. Equal inputs give equal bytes.
/// @param where the template's file, opens the message
/// @throws Error invalid unless the token occurs exactly once
[[nodiscard]] std::string make_page(std::string_view page_template, std::string_view data, const std::string& where);

}  // namespace hamelin::report

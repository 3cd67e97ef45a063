#pragma once
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/io/json.hpp"

namespace hamelin::report {

/// Something that others found about a run, such as a judge's contact.
struct Remark {
  double time_s = 0.0;  ///< an event of the page at this time
  std::string text;
};

struct Options {
  std::size_t frames_max = 2000;       ///< poses of the arm per run, at least 2
  std::size_t plot_points_max = 1500;  ///< points per plotted line, at least 4
  /// Shown with each run, as notes and as events.
  std::vector<Remark> remarks = {};
};

/// Summary of a run in the page.
struct RunSummary {
  /// Name of the planner, or of the integrator in free motion; with the name of the log if several
  /// runs share it.
  std::string name;
  std::filesystem::path log;
  std::string outcome;  ///< as in the log's result; "unfinished" if there is no result
  double time_s = 0.0;  ///< of the last tick
  std::size_t ticks = 0, frames = 0;
  std::vector<std::string> notes;  ///< remarks: inputs that have changed, a truncated log
};

/// Data of a page in the format hamelin.report/1. The README of this library describes the layout
/// of the bytes.
struct Data {
  std::string bytes;
  std::vector<RunSummary> runs;
};

/// Reads logs, plain or zstd, and makes the data of a page. Runs with the same robot, map,
/// obstacles and goals share a world. Clearances, closest points and forces at the tip are
/// recomputed from the robot and the map, which are searched as in simulation::read_header. If the
/// map has changed or is missing, the run has no map and no clearances, and a note says so. A log
/// is read line by line, and memory is bounded by the options. Equal inputs give equal bytes.
/// @throws Error usage for no logs or options out of range; io, parse or invalid for a file that is
///         not a log, a damaged line, or a robot that is missing or does not match the log
[[nodiscard]] Data make_data(const std::vector<std::filesystem::path>& logs,
                             const Options& options = {});

/// Packs JSON without arrays of numbers, as in the pages of sweeps and of accuracy, in the same
/// form as Data::bytes.
[[nodiscard]] std::string pack(const Json& data);

/// The text in a page's template that is replaced by the data.
inline constexpr std::string_view token = "__HAMELIN_REPORT_DATA__";

/// Replaces the token of the template by base64(gzip(data)). Equal inputs give equal bytes.
/// @param where file name of the template, for messages
/// @throws Error invalid unless the token occurs exactly once
[[nodiscard]] std::string make_page(std::string_view page_template, std::string_view data,
                                    const std::string& where);

}  // namespace hamelin::report

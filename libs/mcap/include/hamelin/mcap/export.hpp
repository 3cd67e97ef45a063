#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/mcap/writer.hpp"

namespace hamelin::mcap {

struct ExportSummary {
  std::uint64_t messages = 0;
  std::size_t samples = 0;  ///< ticks, or points at the rate
  double begin_s = 0.0, end_s = 0.0;
  std::vector<std::string> notes;  ///< remarks: inputs that have changed, a truncated log
};

/// Writes the run in a log as an MCAP file for Foxglove and other viewers. The README of this
/// library lists the topics. Robot and map are searched as in simulation::read_header; a map that
/// is missing or has changed is left out, and a note says so. The log is read line by line. Equal
/// inputs give equal bytes.
/// @param rate_hz none: a sample per tick; else as log::resampled()
/// @throws Error usage for a rate out of range; io, parse or invalid for a file that is not a log,
///         a damaged line, times outside of [0, 1e9] s, or a robot that is missing or does not
///         match the log. The sink may have received the beginning of the file.
[[nodiscard]] ExportSummary export_log(const std::filesystem::path& log,
                                       std::optional<double> rate_hz, const Writer::Sink& sink);

}  // namespace hamelin::mcap

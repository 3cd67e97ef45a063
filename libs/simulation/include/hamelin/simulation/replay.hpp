#pragma once
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/simulation/run.hpp"

namespace hamelin::simulation {

/// What a log's header says was run, with its files found again.
struct Recorded {
  enum class Program : std::int32_t { run, integrate };

  Program program = Program::run;
  scene::Scene scene;
  long every = 1;
  /// Files that are missing or not what they were, one line each: "data/maps/shelf.bt: has changed: SHA-256 …". They
  /// are looked for as named, from where the run was started, and from the log's folder.
  struct Changed {
    std::string role, text;
  };
  std::vector<Changed> changed;
  /// What of this program's build or machine is not as then, one line each: bits may differ.
  std::vector<std::string> other_build;
};

/// @param log the log's file, for messages and to find inputs
/// @throws Error invalid for a header that is none, or of a scene that cannot be read
[[nodiscard]] Recorded read_header(const Json& header, const std::filesystem::path& log);

/// The same of a log's first line; a planner of another build than then is told in `other_build` too.
/// @throws Error io or parse too
[[nodiscard]] Recorded read_header(const std::filesystem::path& log,
                                   const std::vector<std::filesystem::path>& plugin_directories);

/// Does it again; `every` and what stops it are the watch's.
/// @throws Error as run() and integrate() do
[[nodiscard]] log::Result repeat(const Recorded& recorded, const std::vector<std::filesystem::path>& plugin_directories,
                                 const Watch& watch);

/// How a run repeated from its log compares to what the log says.
struct Verdict {
  std::size_t lines = 0, ticks = 0;  ///< compared
  bool finished = false;             ///< the log has its result, and it was compared
  bool stopped = false;              ///< from outside, before all was compared
  /// The first difference that is none of the clock's or the machine's.
  struct Difference {
    std::size_t line = 0;   ///< in the log, counted from 1
    std::string type;       ///< of the line: tick, …
    std::optional<long> k;  ///< of a tick, or of the tick line before
    std::optional<double> time_s;
    std::string field;  ///< as a JSON pointer, e.g. "/q/3"
    std::string logged, replayed;
  };
  std::optional<Difference> to_the_bit;  ///< the first difference at all; empty: all bits are equal
  std::optional<Difference> beyond;      ///< the first difference beyond the tolerance
  double largest = 0.0;                  ///< largest |a − b| / max(1, |a|) of two numbers met
};

/// Runs again what the log says and compares line by line; timing and provenance are left out. Ends at the first
/// difference beyond the tolerance. An interrupted run is stopped where it was; of an unfinished log the whole lines
/// are compared.
/// @param recorded the log's header
/// @param tolerance for numbers: |a − b| ≤ tolerance · max(1, |a|); zero: the bits
/// @param watch its log, every and stop_at are not used
/// @throws Error for a log that cannot be read, inputs that changed, or a planner that is not found
[[nodiscard]] Verdict verify(const Recorded& recorded, const std::filesystem::path& log, double tolerance,
                             const std::vector<std::filesystem::path>& plugin_directories, const Watch& watch);

}  // namespace hamelin::simulation

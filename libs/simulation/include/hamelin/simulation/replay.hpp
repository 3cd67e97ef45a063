#pragma once
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/simulation/run.hpp"

namespace hamelin::simulation {

/// The run that a log's header describes, with its input files located.
struct Recorded {
  enum class Program : std::int32_t { run, integrate };

  Program program = Program::run;
  scene::Scene scene;
  long every = 1;
  /// Files that are missing or have changed, one line each: "data/maps/shelf.bt: has changed:
  /// SHA-256 …". They are searched by name from here, from the run's working directory and from the
  /// log's folder.
  struct Changed {
    std::string role, text;
  };
  std::vector<Changed> changed;
  /// Differences of build or machine from those of the log, one line each: bits may differ.
  std::vector<std::string> other_build;
};

/// @param log the log's file, for messages and to find inputs
/// @throws Error invalid if it is not a header, or its scene cannot be read
[[nodiscard]] Recorded read_header(const Json& header, const std::filesystem::path& log);

/// Whether the run has a map from a file, which is available and unchanged.
[[nodiscard]] bool has_original_map(const Recorded& recorded);

/// @throws Error invalid if the joints in the header differ from the robot's
void check_joints(const Json& header, const Recorded& recorded, const model::Robot& robot);

/// Reads the header from a log's first line. `other_build` also names a planner of another build.
/// @throws Error also io or parse
[[nodiscard]] Recorded read_header(const std::filesystem::path& log,
                                   const std::vector<std::filesystem::path>& plugin_directories);

/// Repeats the run. The watch, not the log, gives `every` and when to stop.
/// @throws Error as run() and integrate() do
[[nodiscard]] log::Result repeat(const Recorded& recorded,
                                 const std::vector<std::filesystem::path>& plugin_directories,
                                 const Watch& watch, const PlantFactory& plant_factory = {});

/// Comparison of a repeated run with its log.
struct Verdict {
  std::size_t lines = 0, ticks = 0;  ///< compared
  bool finished = false;             ///< the log has its result, and it was compared
  bool stopped = false;              ///< from outside, before all lines were compared
  /// A difference outside of timing and provenance.
  struct Difference {
    std::size_t line = 0;   ///< in the log, counted from 1
    std::string type;       ///< of the line: tick, …
    std::optional<long> k;  ///< of this tick line or the last one before
    std::optional<double> time_s;
    std::string field;  ///< as a JSON pointer, e.g. "/q/3"
    std::string logged, replayed;
    std::optional<double> size;  ///< |a − b| / max(1, |a|) of two numbers
  };
  std::optional<Difference> first_difference;  ///< empty: all bits are equal
  std::optional<Difference> beyond_tolerance;  ///< the first difference beyond the tolerance
  double largest = 0.0;  ///< largest size of the differences within the tolerance
  /// How both runs end, for example "reached"; empty if the log is unfinished or the repeated run
  /// ended at a difference.
  std::string outcome_logged, outcome_replayed;
};

/// Repeats the run of a log and compares line by line, without timing and provenance, up to the
/// first difference beyond the tolerance, where the repeated run ends. If there is a tolerance and
/// the lines are ticks, it continues for its outcome. An interrupted run
/// is stopped at the same step. Of an unfinished log the complete lines are compared.
/// @param recorded the log's header
/// @param tolerance for numbers: |a − b| ≤ tolerance · max(1, |a|); zero: equal bits. With a
///        tolerance, notes, warnings, causes and the text of events may be worded differently.
/// @param watch its log, every and stop_at are not used
/// @throws Error for a log that cannot be read, changed inputs, or a planner that is not found
[[nodiscard]] Verdict verify(const Recorded& recorded, const std::filesystem::path& log,
                             double tolerance,
                             const std::vector<std::filesystem::path>& plugin_directories,
                             const Watch& watch, const PlantFactory& plant_factory = {});

}  // namespace hamelin::simulation

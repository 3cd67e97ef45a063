#pragma once
#include <cstddef>
#include <string>
#include <vector>

#include "acts.hpp"
#include "bins.hpp"
#include "container.hpp"
#include "drawings.hpp"
#include "frames.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/report/report.hpp"
#include "hamelin/simulation/replay.hpp"
#include "loads.hpp"
#include "plots.hpp"
#include "seen.hpp"
#include "stops.hpp"
#include "world.hpp"

namespace hamelin::report {

/// Makes the data of a run from the lines of a log that follow the header.
class Run {
 public:
  /// @throws Error invalid if the joints in the header differ from the robot's
  Run(const Json& header, const simulation::Recorded& recorded, const World& world,
      const Options& options);
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  /// @param reader knows the position of the line, for messages
  /// @throws Error invalid for a line that does not belong to a log or is out of order
  void add_line(Json line, const log::LogReader& reader);

  /// The JSON object of the run, without its name and world. The Run must not be used afterwards.
  /// @throws Error invalid for a run without a tick
  [[nodiscard]] Json finish(const log::LogReader& reader, Container& container,
                            RunSummary& summary);

 private:
  void add_tick(const Json& line, const log::LogReader& reader);
  /// Takes step and time of a tick.
  void advance(const Json& line, const log::LogReader& reader);
  [[nodiscard]] Frame read_frame(const Json& line, const log::LogReader& reader) const;
  void add_event(const Json& line, const log::LogReader& reader);
  void add_drawing(const Json& line, const log::LogReader& reader);
  void add_stop(const Json& line, const Frame& frame, const log::LogReader& reader);
  /// Notes of what the page omits.
  void add_notes(const log::LogReader& reader);

  const World& world_;
  simulation::Recorded recorded_;
  Plots plots_;
  EvenSample<Frame> sample_;
  Stops stops_;
  Acts acts_;
  Loads loads_;
  Seen seen_;
  Drawings drawings_;
  Json events_ = Json::array(), result_ = nullptr, config_, provenance_;
  std::size_t events_left_out_ = 0, ticks_ = 0, not_finite_ = 0;
  double last_k_ = -1.0, time_s_ = 0.0;
  std::vector<std::string> notes_;
};

}  // namespace hamelin::report

#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

#include "bins.hpp"
#include "container.hpp"
#include "frames.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/report/report.hpp"
#include "hamelin/simulation/replay.hpp"
#include "world.hpp"

namespace hamelin::report {

/// Takes a log's lines behind the header and makes a run of them.
class Run {
 public:
  /// @throws Error invalid if the header's joints are not the robot's
  Run(const Json& header, const simulation::Recorded& recorded, const World& world, const Options& options);

  /// @param reader says where the line stood
  /// @throws Error invalid for a line that is none of a log, or out of order
  void take(Json line, const log::LogReader& reader);

  /// The run's object but for name and world; the run is of no use then.
  /// @throws Error invalid for a run without a tick
  [[nodiscard]] Json finish(const log::LogReader& reader, Container& container, RunSummary& summary);

 private:
  struct Plot {
    const char* id;
    std::string title, unit;
    std::vector<std::pair<std::string, std::size_t>> lines;  ///< label and column
    bool small_numbers;                                      ///< of interest over many powers of ten
  };
  void take_tick(const Json& line, const log::LogReader& reader);
  void goal_distance(const Frame& frame);
  [[nodiscard]] Json plots_json(Container& container) const;
  [[nodiscard]] Json marks(const Plot& plot) const;

  const World& world_;
  simulation::Recorded recorded_;
  dynamics::Workspace ws_;
  std::size_t plotted_joints_;
  std::vector<Plot> plots_;
  std::vector<double> row_;  ///< the columns of one tick
  Bins bins_;
  EvenSample<Frame> sample_;
  Json events_ = Json::array(), result_ = nullptr, config_, provenance_;
  std::size_t events_left_out_ = 0, ticks_ = 0, not_finite_ = 0;
  double k_before_ = -1.0, time_s_ = 0.0, first_balance_ = 0.0;
  std::vector<std::string> notes_;
};

}  // namespace hamelin::report

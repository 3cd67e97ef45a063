#pragma once
#include <functional>
#include <optional>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/log/trajectory.hpp"

namespace hamelin::mcap {

/// Passes on the ticks of a log, or samples between them at a fixed rate as log::resampled()
/// computes them, and the other lines between these, all in the order of their times. It holds one
/// tick and the lines that follow it.
class Sampler {
 public:
  struct Receiver {
    /// @param tick the last tick line up to the time of the point
    std::function<void(const log::Trajectory::Point& point, const Json& tick)> sample;
    std::function<void(double time_s, const Json& line)> line;
  };

  /// @param rate_hz none: every tick
  /// @throws Error usage for a rate that is not positive and finite
  Sampler(std::optional<double> rate_hz, Receiver receiver);

  /// @throws Error usage for a rate that gives more than 1e8 samples
  void add_tick(const log::Trajectory::Point& point, const Json& tick);
  /// A line that is not a tick. A line without a time, or with one before that of the last tick,
  /// gets the time of the last tick.
  void add_line(const Json& line);
  /// Passes on the last tick, and the lines after it.
  void finish();

 private:
  struct Tick {
    log::Trajectory::Point point;
    Json line;
  };
  struct Line {
    double time_s;
    Json line;
  };
  void add_samples(const log::Trajectory::Point& next);
  /// Passes on the lines up to a time.
  void pass_lines(double time_s);

  std::optional<double> rate_hz_;
  Receiver receiver_;
  std::optional<Tick> last_;
  double begin_s_ = 0.0;
  long samples_ = 0;  ///< number of samples passed on
  std::vector<Line> lines_;
};

}  // namespace hamelin::mcap

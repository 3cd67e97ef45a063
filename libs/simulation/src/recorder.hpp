#pragma once
#include <ctime>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/core/time_histogram.hpp"
#include "hamelin/simulation/run.hpp"

namespace hamelin::simulation {

/// CPU time of this thread [s].
[[nodiscard]] inline double thread_cpu_s() noexcept {
  std::timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// Energies and works up to a node [J]. Kinetic + potential + control − booked work stays at its
/// first value except for the scheme's own error, docs/theory.md (8.11).
struct Ledger {
  double kinetic = 0.0, potential = 0.0, control = 0.0;
  double gyroscopic = 0.0, held = 0.0, dissipated = 0.0;  ///< dissipated counts positive
  double stop = 0.0;                                      ///< of the shield's stops
  double node = 0.0;                    ///< of node velocities: law, filter and recovery together
  double filter = 0.0, recovery = 0.0;  ///< parts of `node`, by the planner's account
  double load = 0.0;                    ///< that came with attached objects
  double external = 0.0;                ///< of the surroundings' wrenches

  void book(const integration::StepReport& report, bool stopping) noexcept {
    gyroscopic += report.gyroscopic_work_J;
    (stopping ? stop : held) += report.held_work_J;
    dissipated += report.dissipated_J;
    external += report.external_work_J;
  }
  [[nodiscard]] double balance() const noexcept {
    return kinetic + potential + control -
           (gyroscopic + held + stop - dissipated + node + load + external);
  }
};

/// Collects the figures of a run and writes its log.
class Recorder {
 public:
  /// @param integrator, criterion, tolerance of the scheme that makes the steps
  Recorder(log::Result& result, const Watch& watch, std::string integrator, std::string criterion,
           double tolerance);

  /// @param steps the largest number of steps
  void header(Json fields, const model::Robot& robot, long steps);
  /// Books a node; its balance counts for energy_error_max_J, docs/theory.md (8.12).
  void node(const Ledger& ledger);
  /// |balance − first balance| at the last node [J].
  [[nodiscard]] double energy_error() const noexcept { return energy_error_; }
  /// The ledger at the last node, before the work of its node velocity.
  [[nodiscard]] const Ledger& last_node() const noexcept { return last_node_; }
  void step(const integration::StepReport& report);
  /// Records other figures of a node; h is the step between nodes.
  void observe(double clearance_m, bool certified, const Eigen::VectorXd& v, double h);
  /// The tick's time is known last. The tick's line is written with it.
  void tick_time(double seconds);
  [[nodiscard]] bool wants_tick(long k) const noexcept {
    return watch_.log != nullptr && (k % watch_.every == 0 || k == 0);
  }
  /// Wall time of one call of the planner.
  void controller_time(double seconds) noexcept { controller_us_.add(1e6 * seconds); }
  void planner_time(double seconds) noexcept { planner_us_.add(1e6 * seconds); }
  /// The line of a tick, once per node. It is written by tick_time() or close().
  void tick(long k, Json fields);
  void write_waiting_tick();
  /// @param more fields of its line
  void event(double time_s, const std::string& text, const Json& more = Json::object());
  [[nodiscard]] bool stopped(long k) const noexcept {
    return (watch_.stop != nullptr && watch_.stop->load()) || watch_.stop_at == k ||
           (watch_.log != nullptr && watch_.log->enough());
  }
  void progress(long k, double time_s, double duration_s) const {
    if (watch_.progress && k % 1000 == 0) watch_.progress(time_s, duration_s);
  }
  /// Fills the result's sums and writes the closing lines.
  void close(const Ledger& ledger);

  [[nodiscard]] bool logging() const noexcept { return watch_.log != nullptr; }

 private:
  /// Extrema since the last tick line, so that a log with few lines hides nothing.
  struct Extrema {
    double clearance_m = std::numeric_limits<double>::infinity(), energy_error_J = 0.0,
           residual = 0.0, tick_us = 0.0;
    int updates = 0;
    long halvings = 0;
    bool certified = true;
    Eigen::VectorXd v_abs;
  };
  log::Result& result_;
  const Watch& watch_;
  TimeHistogram tick_us_, controller_us_, planner_us_;
  double started_cpu_s_ = thread_cpu_s();
  double first_balance_ = 0.0, energy_error_ = 0.0;
  Eigen::VectorXd v_last_, a_, a_last_;
  long observed_ = 0;
  Ledger last_node_;
  bool first_ = true;
  long last_logged_ = -1;
  Extrema since_;
  std::optional<Json> waiting_;
};

/// A joint vector as a JSON array.
[[nodiscard]] Json to_json(const Eigen::VectorXd& x);
[[nodiscard]] Json energy_json(const Ledger& ledger);
[[nodiscard]] Json solver_json(const integration::StepReport& report);

/// Number of steps in a duration. @throws Error usage if it is not an integer to 1e-9 steps, zero,
/// or too large
[[nodiscard]] long step_count(double duration_s, double step_s);

}  // namespace hamelin::simulation

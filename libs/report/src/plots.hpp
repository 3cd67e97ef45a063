#pragma once
#include <cstddef>
#include <initializer_list>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bins.hpp"
#include "container.hpp"
#include "frames.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/simulation/replay.hpp"
#include "world.hpp"

namespace hamelin::report {

/// The plots of a run: what its ticks have in numbers, over time.
class Plots {
 public:
  /// Both references must outlive this. @param header of the log
  Plots(const Json& header, const simulation::Recorded& recorded, const World& world,
        std::size_t points_max);

  /// @param line of a tick @param frame what was read from it
  void add(const Json& line, const Frame& frame, const log::LogReader& reader);
  /// The number of the last tick's evasion, if the planner has a series of them.
  [[nodiscard]] std::optional<double> evasion() const;
  [[nodiscard]] Json json(Container& container) const;

 private:
  // Columns of a tick's row after q, v and tau of the joints. Behind them are the planner's series,
  // and the torques as shares of their limits.
  enum Column : std::size_t {
    clearance,
    goal_m,
    goal_rad,
    off_trajectory,
    kinetic,
    potential,
    control,
    gyroscopic,
    filter,
    recovery,
    dissipated,
    held,
    node,
    energy_error,
    updates,
    halvings,
    residual,
    tick_us,
    tick_us_max,
    columns
  };
  struct Plot {
    std::string id;
    std::string title, unit;
    std::vector<std::pair<std::string, std::size_t>> lines;  ///< label and column
    bool wide_range;                                         ///< values cover many powers of ten
  };

  // What is plotted.
  void plan_joints();
  void plan_goals();
  void plan_torque_shares();
  void plan_energy();
  void plan_solver();
  /// A plot for each unit of the planner's own series.
  void plan_series(const Json& header);
  void plan(const char* id, const char* title, const std::string& unit, bool wide_range,
            std::initializer_list<std::pair<const char*, Column>> lines);
  void plan_per_joint(const char* id, const std::string& title, const std::string& unit,
                      std::size_t first_column);
  /// The unit of values of all joints. @param angle, length of revolute and prismatic ones
  [[nodiscard]] std::string joint_unit(const char* angle, const char* length) const;

  // The row of a tick.
  [[nodiscard]] double& at(Column column) { return row_[3 * plotted_joints_ + column]; }
  void set_joints(const Json& line, const Frame& frame, const log::LogReader& reader);
  void set_energy(const Json& energy, const log::LogReader& reader);
  void set_series(const Json& line, const log::LogReader& reader);
  /// Over the steps since the line before.
  void set_extrema(const Json& extrema, const log::LogReader& reader);
  void set_references(const Json& line, const Frame& frame, const log::LogReader& reader);
  void set_goal_distance(const Frame& frame);

  // Horizontal lines of a plot.
  [[nodiscard]] Json marks(const Plot& plot) const;
  void mark_clearance(Json& marks) const;
  void mark_tolerances(const Plot& plot, Json& marks) const;
  void mark_joint_limits(bool of_rates, Json& marks) const;

  const World& world_;
  const simulation::Recorded& recorded_;
  dynamics::Workspace ws_;
  std::size_t plotted_joints_, series_count_, first_series_;
  std::vector<Plot> plots_;
  std::vector<double> row_;  ///< the columns of one tick
  Bins bins_;
  std::optional<std::size_t> evasion_;  ///< number of the series that tells the acts
  std::optional<double> first_balance_;
};

}  // namespace hamelin::report

#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/model/robot.hpp"

/// Masses, inertias and friction of an arm from a record of its motion, docs/theory.md
/// (2.48)–(2.54).
namespace hamelin::identification {

/// How the torques of a record are to be read between two of its ticks.
enum class TorqueTiming : std::int32_t {
  held,    ///< each acts from its tick up to the next, as commands do
  sampled  ///< each was measured at its tick; linear between two ticks
};

/// Positions of the joints and torques of the motors at ticks, in the order of the robot's joints.
/// A torque of the record is what a motor or its gear exerts on a joint: neither friction nor
/// damping of the joint is part of it.
struct Record {
  std::string where;           ///< the file, for messages
  std::vector<double> time_s;  ///< of n ticks, increasing
  Eigen::MatrixXd q;           ///< dof × n [rad or m]
  /// dof × n, or 0 × 0 if there are none; they are added [Nm or N]. held: from the tick up to the
  /// next. sampled: linear between times that are sampled_shift_s later than the ticks.
  Eigen::MatrixXd held, sampled;
  double sampled_shift_s = 0.0;
  Eigen::MatrixXd impulses;  ///< at the ticks, dof × n or 0 × 0 [Nm s or N s]
  /// n flags: whether nothing but gravity and the motors acts from the tick up to the next, and its
  /// numbers are finite.
  std::vector<char> usable;
  /// Dry friction is viscous below this speed, where the source of the record states it [rad/s or
  /// m/s].
  std::optional<double> friction_speed;
  std::vector<std::string> notes;  ///< what was left out, and why

  [[nodiscard]] std::size_t ticks() const noexcept { return time_s.size(); }
};

/// Reads a log of hamelin, plain or zstd, of a run in closed loop. Ticks in contact, under wrenches
/// of the surroundings or with an attached object are marked as not usable.
/// @param every uses each so many ticks; torques that are held are averaged over them
/// @throws Error io, parse or invalid: "file: place: what is wrong, what was expected" for a file
///         that is no log, for joints that are not the robot's, for a log without torques, with a
///         payload, or whose impulses were not all logged
[[nodiscard]] Record read_log(const std::filesystem::path& file, const model::Robot& robot,
                              long every = 1);

/// Reads a table of comma-separated values with the columns time_s, and q_NAME [rad or m] and
/// tau_NAME [Nm or N] for each joint of the robot, in any order. Other columns are ignored, so that
/// velocities, which are often filtered, are not used. Ticks with an empty cell are not usable.
/// @throws Error as read_log
[[nodiscard]] Record read_csv(const std::filesystem::path& file, const model::Robot& robot,
                              TorqueTiming timing, long every = 1);

/// Checks sizes, finite numbers of usable ticks and increasing times.
/// @throws Error invalid
void check(const Record& record, const model::Robot& robot);

/// Each `every`-th tick of a record; see read_log().
[[nodiscard]] Record thinned(const Record& record, long every);

}  // namespace hamelin::identification

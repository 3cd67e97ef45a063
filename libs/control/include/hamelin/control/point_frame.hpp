#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/scene/map_change.hpp"
#include "hamelin/scene/sensors.hpp"

namespace hamelin::control {

/// Points that a depth sensor saw at one time.
struct PointFrame {
  /// The largest number of points of a frame.
  static constexpr Eigen::Index points_max = 2'000'000;

  Eigen::Matrix3Xf points;  ///< 3 × N in the sensor's frame [m], finite
  geometry::SE3 sensor;     ///< pose of the sensor's frame in that of its mount
  scene::Mount mount = scene::Mount::world;
  std::string frame;        ///< name in Model::frames(), of Mount::frame
  std::int32_t source = 0;  ///< the same for all frames of a sensor, another for each sensor
  double time_s = 0.0;      ///< when they were seen, on the clock of Controller::tick()
  /// Of points that are farther only the way up to there is free [m].
  double range_m = std::numeric_limits<double>::infinity();
};

/// What a frame changed.
struct FrameReport {
  std::uint64_t snapshot = 0;             ///< the first that knows the frame
  std::size_t points = 0;                 ///< that were used
  std::size_t on_arm = 0;                 ///< left out: on the arm or its load
  std::size_t on_obstacles = 0;           ///< left out: on obstacles that the world knows
  std::size_t movers = 0;                 ///< bodies that move, which it sees
  std::size_t occupied = 0, cleared = 0;  ///< voxels of the map
  scene::MapChange change;                ///< these voxels
};

/// @throws Error invalid, "points: …", for no point, more than points_max, numbers that are not
///         finite, a range that is not above 0. World::insert_points refuses an unknown frame, too.
void check(const PointFrame& frame);

}  // namespace hamelin::control

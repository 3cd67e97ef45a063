#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/scene/boxes.hpp"
#include "hamelin/scene/map_change.hpp"
#include "hamelin/scene/map_file.hpp"
#include "hamelin/scene/obstacles.hpp"
#include "hamelin/scene/shapes.hpp"

namespace hamelin::scene {

/// The meaning of unknown space: free; free, but to be crossed slowly; an obstacle.
enum class UnknownPolicy : std::int32_t { free, slow, block };

[[nodiscard]] std::string_view to_string(UnknownPolicy policy) noexcept;

/// How the points of depth sensors change a map.
struct PointsSpec {
  /// Points this near to the arm, its load or a known obstacle are left out.
  double margin_m = 0.03;
  double time_error_s = 0.0;  ///< by which the time of a frame may be wrong, either way
  double age_max_s = 0.5;     ///< frames that come later after they were seen are refused
  /// Whether bodies that move are followed, and become obstacles instead of voxels.
  bool movers = true;
  /// Whether single unknown voxels between free ones count as free.
  bool close_gaps = true;
  /// That a voxel is occupied, as probabilities: by one point, by one ray that passes it, and by
  /// all together at least and at most. By these, one point occupies, and three rays free.
  double hit = 0.7, miss = 0.4, least = 0.4, most = 0.75;
};

/// A map as given in a scene.
struct MapSpec {
  std::filesystem::path file;  ///< empty: nothing is known, see resolution_m
  /// Edge of a voxel of a map without a file [m].
  double resolution_m = 0.01;
  geometry::SE3 pose;                              ///< of the map's frame in the world
  Quaternion quaternion_wxyz{1.0, 0.0, 0.0, 0.0};  ///< see Quaternion
  std::optional<double> scale;                     ///< metres per unit of the file
  double occupancy_threshold = 0.5;
  UnknownPolicy unknown = UnknownPolicy::free;
  double keep_out_radius_m = 0.0;  ///< unknown voxels that touch this ball at the base are free
  /// If given, the map contains the robot itself: voxels are removed that touch its shapes at the
  /// start, with radii increased by this [m].
  std::optional<double> self_filter_padding_m;
  /// Whether a controller is shown it; else it knows nothing at first, and sensors see the map.
  bool known = true;
  std::vector<MapChangeSpec> changes;  ///< in the order of their times
  PointsSpec points;
};

/// The padding of a self-filter if the scene gives none [m].
inline constexpr double default_self_filter_padding_m = 0.02;

/// Shares of a ball's volume by kind of space, docs/theory.md (11.38); they add up to one.
/// Everything beyond the octree is unknown. See volume_inside() for their accuracy.
struct Shares {
  double occupied = 0.0, free = 0.0, unknown = 0.0;
};

/// @param ball in the map's frame [m]; zero shares if its radius is zero
[[nodiscard]] Shares shares_within(const MapData& map, const Ball& ball);

/// The same of the map of a scene, for the ball that an arm can reach.
/// @param base of the arm @param reach [m] @throws Error as read_map()
[[nodiscard]] Shares shares_within_reach(const MapSpec& map, const geometry::SE3& base,
                                         double reach);

/// The robot's shapes at the start of a run, in the world.
struct RobotAtStart {
  Shapes arm;   ///< of the links
  Shapes base;  ///< of the fixed base
};

/// What was read, and what remains of it within the arm's reach.
struct MapSummary {
  bool has_map = false;
  std::string map_file, map_sha256;
  double resolution_m = 0.0;
  std::size_t nodes = 0;
  std::size_t leaves = 0;          ///< occupied leaves in the file
  std::size_t leaves_cropped = 0;  ///< of these within reach + influence
  std::size_t free_leaves = 0;     ///< in the file
  /// Of the file's map, before any removal; none where unknown space is free.
  std::optional<Shares> within_reach;
  UnknownPolicy unknown = UnknownPolicy::free;
  std::optional<double> self_filter_padding_m;
  std::size_t self_filter_voxels = 0;          ///< occupied voxels that the self-filter removed
  std::size_t self_filter_leaves = 0;          ///< occupied leaves that lost any voxel
  std::size_t self_filter_unknown_voxels = 0;  ///< unknown voxels, unless unknown space is free
  std::size_t leaves_in_arm = 0;  ///< without a self-filter: that touch the arm at its start
  std::vector<std::string> warnings;
};

/// The part of a map that an arm can come near, in the map's frame.
struct MapRegion {
  double resolution_m = 0.0;
  Ball ball;                   ///< what was kept: reach + influence around the base
  Ball reachable;              ///< reach around the base
  std::vector<Cell> occupied;  ///< whole cells that touch the ball
  std::vector<Cell> unknown;   ///< likewise; empty where unknown space is free
  MapSummary summary;
};

/// The map of a scene, or one in which all of a ball is unknown if it has no file.
/// @throws Error as the other read_map(); invalid for a resolution that is not above 0
[[nodiscard]] MapData read_map(const MapSpec& map, const Ball& ball);

/// Reads a map and reduces it to what an arm can come near: shares within reach, crop, self-filter,
/// unknown space by its policy, keep-out around the base.
/// @param base pose of the robot's base frame in the world
/// @param reach, influence see Environment [m]
/// @param robot for the self-filter, or to detect a map that contains the robot itself
/// @throws Error io, parse or invalid for the map, also if unknown space blocks although nothing
///        within reach is free and most of it is unknown; usage for reach and influence
[[nodiscard]] MapRegion read_region(const MapSpec& map, const geometry::SE3& base, double reach,
                                    double influence, const RobotAtStart& robot = {});

}  // namespace hamelin::scene

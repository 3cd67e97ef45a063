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

/// What unknown space means: as if free; free, but to be crossed slowly; an obstacle.
enum class UnknownPolicy : std::int32_t { free, slow, block };

[[nodiscard]] std::string_view to_string(UnknownPolicy policy) noexcept;

/// A map as a scene names it.
struct MapSpec {
  std::filesystem::path file;
  geometry::SE3 pose;                              ///< of the map's frame in the world
  Quaternion quaternion_wxyz{1.0, 0.0, 0.0, 0.0};  ///< see Quaternion
  std::optional<double> scale;                     ///< metres per unit of the file
  double occupancy_threshold = 0.5;
  UnknownPolicy unknown = UnknownPolicy::free;
  double keep_out_radius_m = 0.0;  ///< unknown voxels touched by this ball around the base count as free
  /// If given: the map holds the robot itself, so voxels are taken out that its shapes, this much thicker, touch at the
  /// start [m].
  std::optional<double> self_filter_padding_m;
  std::vector<MapChangeSpec> changes;  ///< by time
};

/// The padding of a self-filter that a scene does not give [m].
inline constexpr double default_self_filter_padding_m = 0.02;

/// What a ball holds of each kind of space, as shares of its volume that add up to one. Beyond the octree all is
/// unknown. See volume_inside() for how exact they are.
struct Shares {
  double occupied = 0.0, free = 0.0, unknown = 0.0;
};

/// @param ball in the map's frame [m]; zero shares if its radius is zero
[[nodiscard]] Shares shares_within(const MapData& map, const Ball& ball);

/// The robot where it stands when a run begins, in the world.
struct RobotAtStart {
  Shapes arm;   ///< what moves
  Shapes base;  ///< what does not
};

/// What was read and what is left of it where the arm can be.
struct MapSummary {
  bool has_map = false;
  std::string map_file, map_sha256;
  double resolution_m = 0.0;
  std::size_t nodes = 0;
  std::size_t leaves = 0;          ///< occupied leaves in the file
  std::size_t leaves_cropped = 0;  ///< of these within reach + influence
  std::size_t free_leaves = 0;     ///< in the file
  Shares within_reach;             ///< of the file's map, before anything is taken out of it
  UnknownPolicy unknown = UnknownPolicy::free;
  std::optional<double> self_filter_padding_m;
  std::size_t self_filter_voxels = 0;          ///< occupied ones that the self-filter took out
  std::size_t self_filter_leaves = 0;          ///< occupied leaves that lost any
  std::size_t self_filter_unknown_voxels = 0;  ///< unknown ones, unless unknown space is free
  std::size_t leaves_in_arm = 0;               ///< without a self-filter: occupied ones that touch the arm at its start
  std::vector<std::string> warnings;
};

/// A map cut down to what an arm can come near, in the map's frame.
struct MapRegion {
  double resolution_m = 0.0;
  Ball ball;                   ///< what was kept: reach + influence around the base
  Ball reachable;              ///< where the arm can be: reach around the base
  std::vector<Cell> occupied;  ///< whole cells that touch the ball
  std::vector<Cell> unknown;   ///< likewise; empty where unknown space is free
  MapSummary summary;
};

/// Reads a map and cuts it down: shares within reach, crop, self-filter, unknown space by its policy, keep-out around
/// the base.
/// @param base pose of the robot's base frame in the world
/// @param reach, influence see Environment [m]
/// @param robot for the self-filter, and to notice a map that holds the robot itself
/// @throws Error io, parse or invalid for the map, also where unknown space blocks and there is no free space within
///         reach though most of it is unknown; usage for reach and influence
[[nodiscard]] MapRegion read_region(const MapSpec& map, const geometry::SE3& base, double reach, double influence,
                                    const RobotAtStart& robot = {});

}  // namespace hamelin::scene

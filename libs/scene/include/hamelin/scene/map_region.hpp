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
#include "hamelin/scene/map_file.hpp"
#include "hamelin/scene/obstacles.hpp"

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
};

/// What was read and what is left of it where the arm can be.
struct MapSummary {
  bool has_map = false;
  std::string map_file, map_sha256;
  double resolution_m = 0.0;
  std::size_t nodes = 0;
  std::size_t leaves = 0;          ///< occupied leaves in the file
  std::size_t leaves_cropped = 0;  ///< of these within reach + influence
  double unknown_share = 0.0;      ///< of the ball of radius reach around the base
  UnknownPolicy unknown = UnknownPolicy::free;
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

/// Reads a map and cuts it down: crop, unknown space by its policy, keep-out around the base, shares within reach.
/// @param base pose of the robot's base frame in the world
/// @param reach, influence see Environment [m]
/// @throws Error io, parse or invalid for the map, usage for reach and influence
[[nodiscard]] MapRegion read_region(const MapSpec& map, const geometry::SE3& base, double reach, double influence);

}  // namespace hamelin::scene

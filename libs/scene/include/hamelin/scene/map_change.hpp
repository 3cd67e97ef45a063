#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/scene/boxes.hpp"

namespace hamelin::scene {

/// How a map is to change during a run, as a scene names it.
struct MapChangeSpec {
  double time_s = 0.0;
  /// An OctoMap of the map's own resolution and frame: what is occupied or free there is so from then on, what it does
  /// not know stays as it is.
  std::optional<std::filesystem::path> file;
  std::vector<Box> free_m, occupied_m;  ///< voxels that these boxes touch, map's frame [m]; free ones first
};

struct MapSpec;
struct MapRegion;

/// A change, ready to be made: voxels freed first, then occupied ones.
struct MapChange {
  double time_s = 0.0;
  std::vector<VoxelBox> free, occupied;  ///< each of them disjoint
};

/// Reads what a change needs and crops it to the region.
/// @throws Error io, parse or invalid, one line
[[nodiscard]] MapChange read_change(const MapChangeSpec& change, const MapSpec& map, const MapRegion& region);

}  // namespace hamelin::scene

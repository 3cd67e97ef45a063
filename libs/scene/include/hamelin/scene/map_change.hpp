#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/scene/boxes.hpp"

namespace hamelin::scene {

/// A change of the map during a run, as given in a scene.
struct MapChangeSpec {
  double time_s = 0.0;
  /// An OctoMap with the resolution and frame of the map. Its occupied and free voxels replace
  /// those of the map; voxels that are unknown in it stay unchanged.
  std::optional<std::filesystem::path> file;
  std::vector<Box> free_m, occupied_m;  ///< boxes in the map's frame [m]; voxels are freed first
};

struct MapSpec;

/// A change in voxels, ready to be applied: first `free`, then `occupied`.
struct MapChange {
  double time_s = 0.0;
  std::vector<VoxelBox> free, occupied;  ///< disjoint boxes each
};

/// Reads a change and crops it to a ball in the map's frame.
/// @param resolution_m of the map
/// @throws Error io, parse or invalid, one line
[[nodiscard]] MapChange read_change(const MapChangeSpec& change, const MapSpec& map,
                                    double resolution_m, const Ball& ball);

}  // namespace hamelin::scene

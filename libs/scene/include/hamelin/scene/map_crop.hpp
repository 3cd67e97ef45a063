#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <variant>

#include "hamelin/scene/boxes.hpp"
#include "hamelin/scene/map_file.hpp"

namespace hamelin::scene {

struct CropOptions {
  std::filesystem::path map;
  ReadMapOptions read;             ///< keep_free is set anyway
  std::variant<Ball, Box> region;  ///< in the map's frame, in metres after scaling
  bool unknown_is_free = false;    ///< write unknown space that touches the region as free
  std::filesystem::path output;    ///< a .bt file other than the map
};

struct CropReport {
  std::string sha256;
  std::size_t bytes_before = 0, bytes = 0;
  std::size_t nodes_before = 0, nodes = 0;
  std::size_t occupied_leaves_before = 0, occupied_leaves = 0;
  std::size_t free_leaves_before = 0, free_leaves = 0;
  double resolution_m = 0.0;
  std::vector<std::string> warnings;  ///< of the map that was read
};

/// Writes the part of a map that touches a region as a `.bt`, atomically. Leaves that touch the
/// region are kept whole. So inside the region occupied, free and unknown space are those of the
/// map, voxel by voxel; beyond these leaves everything is unknown. The unit of the file is the
/// metre, so it is read without a scale.
/// @throws Error io, parse or invalid, also if the output is the map itself, or no part of the map
///        is in the region
CropReport crop_map(const CropOptions& options);

}  // namespace hamelin::scene
